"""Modules in a row from trained models of one (predict/rows/serial.py): nothing is fitted, the dataset judges."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.load import build, read_model
from cfem.predict.protocol import Predictor
from cfem.predict.rows.serial import CENTRE, END, joined
from cfem.surrogate.spec import SerialSpec

_END = ("x", "y", "z", "rx", "ry", "rz")
_CENTRE = ("x", "y", "z")
WEIGHS = 0.01  # share of the mass by which the modules may miss that of the whole


def folders(spec: SerialSpec) -> list[Path]:
    """Folders of the models, each once."""
    return list(dict.fromkeys(module.model for module in spec.modules))


def compose(
    training: Any, spec: SerialSpec, folder: Path | None = None
) -> tuple[dict[str, np.ndarray], dict[str, Any], list[dict[str, Any]]]:
    """Arrays, what model.json says of them, and how the modules' models learned. InputError where they do not go
    together: other effectors, another number of actuators, another mass."""
    paths = folders(spec)
    cards, arrays = zip(*map(read_model, paths), strict=True)
    history = [row for card in cards for row in card.pop("history")]
    for folder, card, weights in zip(paths, cards, arrays, strict=True):
        _demand_module(folder, card, build(card, weights))
    row = [{"model": paths.index(module.model), "softer": module.softer} for module in spec.modules]
    _demand_whole(training, spec, [cards[place["model"]] for place in row])
    samples = sum(card["dataset"].get("samples", 0) for card in cards)
    return (
        joined(list(arrays)),
        {"form": "displacement", "modules": list(cards), "row": row, "samples": samples},
        history,
    )


def _demand_module(folder: Path, card: dict[str, Any], module: Predictor) -> None:
    """Raises InputError where a model is not one of a module: an end with its orientation, perhaps a centre of mass,
    form displacement."""
    effectors = module.rows.effectors
    axes = tuple(name.rsplit(".", 1)[-1] for name in effectors)
    named = {name.rsplit(".", 1)[0] for name in effectors[END:]} == set(card.get("masses", {}))
    fits = axes[:END] == _END and (len(axes) == END or (axes[END:] == _CENTRE and named))
    if not fits or module.form != "displacement" or module.parameters:
        raise InputError(
            f"must be of form displacement, of one end with its orientation ({', '.join(_END)}) and perhaps a centre "
            f"of mass after it, without parameters; it is of form {module.form}, of {', '.join(effectors)}",
            where=str(folder),
            do="sample a scene of one module whose effector has `orientation: true`",
        )


def _demand_whole(training: Any, spec: SerialSpec, cards: list[dict[str, Any]]) -> None:
    """Raises InputError where the modules do not make up the robot of the dataset: its actuators, effectors and
    mass."""
    rows, n_a = training.rows, sum(len(card["rows"]["actuators"]) for card in cards)
    masses = training.meta.get("masses", {})
    heavy = len(rows.effectors) == 3 + CENTRE and set(masses) == {rows.effectors[3].rsplit(".", 1)[0]}
    if not (len(rows.effectors) == 3 or heavy) or rows.n_a != n_a:
        counts = " and ".join(str(len(card["rows"]["actuators"])) for card in cards)
        raise InputError(
            f"{len(cards)} modules of {counts} actuators do not make a robot of {rows.n_a} actuators "
            f"and effectors {', '.join(rows.effectors)}",
            where="model.modules",
            do="a row has the actuators of its modules, and for effectors its tip and perhaps its centre of mass",
        )
    if not heavy:
        return
    if not all(card.get("masses") for card in cards):
        light = next(module.model for module, card in zip(spec.modules, cards, strict=True) if not card.get("masses"))
        what = "has no centre of mass, and the row has one"
        do = "give its scene an effector `at: centre-of-mass` behind the end, or take that of the row away"
        raise InputError(what, where=str(light), do=do)
    total, mass = sum(sum(card["masses"].values()) for card in cards), sum(masses.values())
    if abs(total - mass) > WEIGHS * mass:
        what = f"the modules weigh {1e6 * total:.4g} g together, and the whole robot {1e6 * mass:.4g} g"
        raise InputError(what, where="model.modules", do="give both scenes the same densities and geometry")
