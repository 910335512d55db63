"""Mini-batch descent on the mean squared error, which can be killed at any moment and goes on where it was kept last.

All rows are one tensor on the device, shuffled once an epoch and cut into batches of equal size."""

import io
import math
import time
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from cfem.core.artefact.files import write_whole
from cfem.core.errors import NumericalError
from cfem.surrogate.spec import MlpSpec

CHECKPOINT_SECONDS = 20.0
Rows = tuple[Tensor, Tensor]  # inputs (m, inputs) and targets (m, outputs), standardised, float32, on one device


class TrainingState:
    """All that the rest of a training depends on, besides its rows and its spec.

    record: epoch; best, best_epoch, best_state: the least validation loss, when, and the network then; history."""

    def __init__(self, net: nn.Module, spec: MlpSpec):
        self.net, self.spec = net, spec
        self.optimiser = torch.optim.Adam(net.parameters(), spec.learning_rate, fused=True)
        self.schedule = schedule(self.optimiser, spec)
        self.record: dict[str, Any] = {"epoch": 0, "best": math.inf, "best_epoch": 0, "best_state": {}, "history": []}

    @property
    def ended(self) -> bool:
        epoch = self.record["epoch"]
        return epoch == self.spec.epochs or epoch - self.record["best_epoch"] >= self.spec.patience

    @property
    def on_gpu(self) -> bool:
        return next(self.net.parameters()).is_cuda

    def save(self, path: Path) -> None:
        random = {"cpu": torch.get_rng_state()}
        if self.on_gpu:
            random["cuda"] = torch.cuda.get_rng_state()
        states = [part.state_dict() for part in self._parts()]
        buffer = io.BytesIO()
        torch.save({"states": states, "random": random, "record": self.record}, buffer)
        write_whole(path, buffer.getvalue())

    def load(self, path: Path) -> None:
        data = torch.load(path, map_location="cpu", weights_only=True)
        for part, state in zip(self._parts(), data["states"], strict=True):
            part.load_state_dict(state)
        self.record = data["record"]
        torch.set_rng_state(data["random"]["cpu"])
        if self.on_gpu:
            torch.cuda.set_rng_state(data["random"]["cuda"])

    def _parts(self) -> list[Any]:
        return [self.net, self.optimiser, self.schedule]


def schedule(optimiser: torch.optim.Optimizer, spec: MlpSpec) -> Any:
    kinds = torch.optim.lr_scheduler
    if spec.schedule == "cosine":
        return kinds.CosineAnnealingLR(optimiser, spec.epochs)
    return kinds.ReduceLROnPlateau(optimiser, factor=0.5, patience=max(spec.patience // 5, 1))


def descend(
    net: nn.Module, fitted: Rows, held_out: Rows, spec: MlpSpec, checkpoint: Path | None = None
) -> dict[str, Any]:
    """Trains `net` on the rows `fitted` and leaves it at its best epoch on `held_out`; the record of `TrainingState`.
    Ends early where the best epoch is `patience` epochs old.

    checkpoint: where the state is kept every CHECKPOINT_SECONDS and at the end, and found. Draws from torch's
    global generators. NumericalError where the loss is no longer finite."""
    state = TrainingState(net, spec)
    if checkpoint is not None and checkpoint.exists():
        state.load(checkpoint)
    record, kept = state.record, time.monotonic()
    while not state.ended:
        training, validation = epoch(state, fitted, held_out)
        record["epoch"] += 1
        if not math.isfinite(validation):
            raise NumericalError(f"training diverges in epoch {record['epoch']}", do="lower model.learning_rate")
        if validation < record["best"]:
            best_state = {name: value.clone() for name, value in net.state_dict().items()}
            record.update(best=validation, best_epoch=record["epoch"], best_state=best_state)
        if state.ended or record["epoch"] % max(spec.epochs // 100, 1) == 0:
            losses = {"training": training, "validation": validation}
            rate = state.optimiser.param_groups[0]["lr"]
            record["history"].append({"epoch": record["epoch"], **losses, "learning_rate": rate})
        state.schedule.step(*([validation] if spec.schedule == "plateau" else []))
        if checkpoint is not None and (state.ended or time.monotonic() - kept > CHECKPOINT_SECONDS):
            state.save(checkpoint)
            kept = time.monotonic()
    net.load_state_dict(record["best_state"])
    return record


def epoch(state: TrainingState, fitted: Rows, held_out: Rows) -> tuple[float, float]:
    """The mean loss of the batches on the way, and the loss of the held-out rows after."""
    loss_of, net = nn.functional.mse_loss, state.net
    count = len(fitted[0])
    order = torch.randperm(count, device=fitted[0].device)
    batches = [values[order].tensor_split(-(-count // state.spec.batch_size)) for values in fitted]
    net.train()
    total = torch.zeros((), device=fitted[0].device)
    for x, y in zip(*batches, strict=True):
        loss = loss_of(net(x), y)
        net.zero_grad()
        loss.backward()
        state.optimiser.step()
        total += loss.detach() * len(x)
    net.eval()
    with torch.no_grad():
        return total.item() / count, loss_of(net(held_out[0]), held_out[1]).item()
