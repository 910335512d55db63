"""A torch module as the file of a policy, for controllers without torch."""

import json
import logging
import warnings
from pathlib import Path
from typing import Any

from cfem.condensed.parameters import to_json
from cfem.core.optional import demand
from cfem.gym.moving_world import MovingWorld
from cfem.gym.policy import FORMAT, KEY
from cfem.gym.world import World


def facts_of(world: World | MovingWorld) -> dict[str, Any]:
    """Facts that a controller needs beside the weights, as plain data."""
    scales, rows, motion = world.scales, world.model.rows, {}
    if isinstance(world, MovingWorld):
        motion = {"ahead": world.ahead, "history": world.history, "tick": world.tick}
        parameters, command = [], world.command
    else:
        parameters, command = to_json(world.model.parameters) if world.observes_parameters else [], "displacement"
    return {
        "format": FORMAT,
        "task": world.name,
        "command": command,
        "moving": motion,
        "parameters": parameters,
        "effectors": list(rows.effectors),
        "actuators": list(rows.actuators),
        "scale": scales.scale,
        "near": scales.near,
        "step": scales.step.tolist(),
        "low": scales.low.tolist(),
        "reach": scales.reach.tolist(),
    }


def save_policy(module: Any, path: Path | str, world: World | MovingWorld) -> None:
    """Writes a policy as ONNX. module: a torch module, observations (B, n) -> actions (B, n_a), the mean of what it
    would try."""
    save_network(module, path, world.sizes[0], facts_of(world))


def save_network(module: Any, path: Path | str, seen: int, facts: dict[str, Any]) -> None:
    """Writes a policy of any environment as ONNX. seen: numbers of an observation; facts: plain data beside the
    network."""
    demand("torch", "onnx", "onnxscript", where="save_policy")
    import onnx
    import torch

    batch = torch.export.Dim("batch")
    noisy = logging.getLogger("torch.onnx")  # of packages that are not there and of what will change in them
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        level, noisy.level = noisy.level, logging.ERROR
        program = torch.onnx.export(
            module.eval(), (torch.zeros(2, seen),), dynamic_shapes=({0: batch},), dynamo=True, verbose=False,
            input_names=["observation"], output_names=["action"],
        )  # fmt: skip
        noisy.level = level
    model = program.model_proto
    onnx.helper.set_model_props(model, {KEY: json.dumps(facts)})
    onnx.save(model, str(path))
