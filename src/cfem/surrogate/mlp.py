"""Trains the paper's network F on the entries of W and delta_free, standardised, by mean squared error.

The inputs are delta_a alone: without design parameters the paper's further inputs W0 and delta_free0 are constant.
Every tenth training row validates: it steers the schedule and picks the epoch. Test rows never come here."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import nn

from cfem.condensed import pack_upper
from cfem.surrogate.error_measures import CONSTANT
from cfem.surrogate.spec import MlpSpec
from cfem.surrogate.torch_model import Mlp

VALIDATION_STRIDE = 10


@dataclass(frozen=True)
class Training:
    """model: at its best epoch on validation; history: one record a hundredth of the epochs, standardised losses."""

    model: Mlp
    best_epoch: int
    history: list[dict[str, float]]


def train(dataset: Any, spec: MlpSpec) -> Training:
    """Adam with the schedule of `spec` on all rows of `dataset` (cfem.dataset.reader.Dataset, training rows only)."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(spec.seed)
        model = Mlp(dataset.rows, spec.width, spec.depth, spec.activation, spec.dropout)
        validation = np.arange(len(dataset.delta_a)) % VALIDATION_STRIDE == VALIDATION_STRIDE - 1
        inputs, targets = standardise(model, dataset, ~validation)
        return descend(model, inputs, targets, torch.as_tensor(validation), spec)


def standardise(model: Mlp, dataset: Any, fitted: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    """Sets the model's means and scales from the rows `fitted` (m,) bool; returns all rows standardised, float32."""
    packed, delta_free = pack_upper(dataset.W), dataset.delta_free
    outputs = np.hstack([packed, delta_free])
    size = np.repeat([np.abs(packed).max(), np.abs(delta_free).max()], [packed.shape[1], delta_free.shape[1]])
    deviation = outputs[fitted].std(axis=0)
    constant = deviation <= CONSTANT * size
    model.in_mean.copy_(torch.as_tensor(dataset.delta_a[fitted].mean(axis=0)))
    model.in_scale.copy_(torch.as_tensor(dataset.delta_a[fitted].std(axis=0)))
    model.out_mean.copy_(torch.as_tensor(outputs[fitted].mean(axis=0)))
    model.out_scale.copy_(torch.as_tensor(np.where(constant, 0.0, deviation)))
    inputs = (torch.tensor(dataset.delta_a) - model.in_mean) / model.in_scale
    targets = (outputs - outputs[fitted].mean(axis=0)) / np.where(constant, np.inf, deviation)
    return inputs.float(), torch.as_tensor(targets).float()


def descend(
    model: Mlp, inputs: torch.Tensor, targets: torch.Tensor, validation: torch.Tensor, spec: MlpSpec
) -> Training:
    """Mini-batches, best epoch on validation kept; stops early where that is `patience` epochs old."""
    x, y = inputs[~validation], targets[~validation]
    optimiser = torch.optim.Adam(model.net.parameters(), lr=spec.learning_rate)
    if spec.schedule == "cosine":
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, spec.epochs)
    else:
        schedule = torch.optim.lr_scheduler.ReduceLROnPlateau(optimiser, factor=0.5, patience=spec.patience // 5)
    best, best_epoch, best_state, history = np.inf, 0, {}, []
    for epoch in range(1, spec.epochs + 1):
        model.train()
        total = 0.0
        for batch in torch.randperm(len(x)).split(spec.batch_size):
            loss = nn.functional.mse_loss(model.net(x[batch]), y[batch])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += loss.item() * len(batch)
        model.eval()
        with torch.no_grad():
            held_out = nn.functional.mse_loss(model.net(inputs[validation]), targets[validation]).item()
        if held_out < best:
            best, best_epoch = held_out, epoch
            best_state = {name: value.clone() for name, value in model.state_dict().items()}
        ends = epoch == spec.epochs or epoch - best_epoch >= spec.patience
        if ends or epoch % max(spec.epochs // 100, 1) == 0:
            rate = optimiser.param_groups[0]["lr"]
            history.append({"epoch": epoch, "training": total / len(x), "validation": held_out, "learning_rate": rate})
        if ends:
            break
        schedule.step(*([held_out] if spec.schedule == "plateau" else []))
    model.load_state_dict(best_state)
    return Training(model, best_epoch, history)
