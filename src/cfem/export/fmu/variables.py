"""What goes into and comes out of each FMU: its variables, by block of the C code (sources/fmu)."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cfem.export.spec import CSpec
from cfem.motion.model import MotionModel
from cfem.predict.protocol import Predictor

UNKNOWN = float("nan")


@dataclass(frozen=True)
class Variable:
    """A scalar. unit: as of rows of the model, empty for a count or a state; input: or output; missing: whether it may
    be NaN; start: of an input; state: of a robot in motion, or the derivative of one, `derivative`."""

    name: str
    unit: str
    description: str
    input: bool = False
    missing: bool = False
    start: float = 0.0
    state: bool = False
    derivative: bool = False

    @property
    def counts(self) -> bool:
        return not self.unit and not self.state


Blocks = dict[str, list[Variable]]  # by the name in C, CFEM_FMU_GOAL of GOAL


def controller_blocks(model: Predictor, spec: CSpec) -> Blocks:
    """Variables of the FMU of the controller: goals and samples in, commands and references out."""
    places = _places(model)
    blocks = {
        "GOAL": _inputs("goal", places, "where it should be, absolute", model.rest_e),
        "MEASURED": _inputs("measured", places, "where it was measured, absolute", UNKNOWN),
        "SAMPLE_AGE": [
            Variable(
                "sample_age",
                "",
                "commands since `measured` was taken: 1 where it followed the last one; 0 where nothing is measured",
                True,
            )
        ],
    }
    if spec.controller.observer == "measured":
        strokes = zip(model.rows.actuators, (unit for unit, _ in model.actuator_units), strict=True)
        blocks["DISPLACEMENT"] = _inputs("displacement", strokes, "where the actuator is measured", 0.0)
    return {
        **blocks,
        "COMMAND": _outputs("command", _commanded(model, spec), f"{spec.controller.command} that the drive takes"),
        "REFERENCE": _outputs("reference", places, "where it will be as far as limits allow, absolute"),
        "STATUS": [Variable("status", "", "0, or an OR of the bits of cfem.h")],
    }


def robot_blocks(model: Predictor, spec: CSpec, home: np.ndarray) -> Blocks:
    """home (n_a,): the command at the start."""
    strokes, forces = (
        zip(model.rows.actuators, units, strict=True) for units in zip(*model.actuator_units, strict=True)
    )
    return {
        "COMMAND": _inputs("command", _commanded(model, spec), f"{spec.controller.command} of the actuator", home),
        "POSITION": _outputs("position", _places(model), "where it is, absolute"),
        "DISPLACEMENT": _outputs("displacement", strokes, "of the actuator"),
        "FORCE": _outputs("force", forces, "of the actuator"),
        "OUTSIDE": [Variable("outside", "", "1 where the state lies outside of the model's training, else 0")],
    }


def state_blocks(motion: MotionModel) -> Blocks:
    """Continuous states of a robot in motion, and their derivatives."""
    names = [f"{kind}[{i + 1}]" for kind in ("place", "momentum") for i in range(motion.n_q)]
    terms = sum(len(loss.prony) for loss in motion.losses)
    names += [f"memory[{term + 1},{i + 1}]" for term in range(terms) for i in range(motion.n_q)]
    states = [Variable(name, "", "in motion", state=True) for name in names]
    rates = [Variable(f"der({name})", "", "by time", state=True, derivative=True) for name in names]
    return {"STATE": states, "RATE": rates}


def estimator_blocks(model: Predictor, spec: CSpec) -> Blocks:
    """Variables of the FMU of the estimator: markers, sensors and commands in, the estimate and its deviations out."""
    estimate, names = spec.estimate, model.rows.actuators
    strokes, forces = ([*zip(names, units, strict=True)] for units in zip(*model.actuator_units, strict=True))
    driven = "displacement" if estimate.dynamics is None else estimate.dynamics.driven
    commanded = strokes if driven == "displacement" else forces
    loads = [
        (name, "N mm" if re.search(r"\.r[xyz]$", name) else "N")
        for name in (estimate.loads.rows if estimate.loads else ())
    ]
    unknowns = [*((f"displacement.{_name(n)}", unit) for n, unit in strokes)]
    unknowns += [(f"force.{_name(name)}", unit) for name, unit in loads]
    axes = [(f"{_name(name)}.{axis}", "mm") for name in estimate.markers for axis in "xyz"]
    return {
        "MARKER": _inputs("marker", axes, "where it is seen; NaN: not seen", UNKNOWN, named=True),
        "DISPLACEMENT": _inputs("displacement", strokes, "by the actuator's sensor; NaN: not measured", UNKNOWN),
        "FORCE": _inputs("force", forces, "by the actuator's load cell; NaN: not measured", UNKNOWN),
        "COMMAND": _inputs("command", commanded, f"{driven} that was commanded; NaN: not known", UNKNOWN),
        "ESTIMATE": _outputs("estimate", unknowns, "estimated", named=True),
        "DEVIATION": _outputs("deviation", unknowns, "standard deviation of the estimate", named=True),
        "POSITION": _outputs("position", _places(model), "where it is estimated, absolute"),
        "STATUS": [Variable("status", "", "0, or an OR of the bits of cfem_estimate.h")],
    }


def _places(model: Predictor) -> list[tuple[str, str]]:
    """Names and units of the effectors' rows."""
    return [(name, unit) for name, (unit, _) in zip(model.rows.effectors, model.meta["row_units"], strict=False)]


def _commanded(model: Predictor, spec: CSpec) -> list[tuple[str, str]]:
    which = ("displacement", "force").index(spec.controller.command)
    return [(name, units[which]) for name, units in zip(model.rows.actuators, model.actuator_units, strict=True)]


def _inputs(
    block: str, scalars: Iterable[tuple[str, str]], description: str, start: np.ndarray | float, named: bool = False
) -> list[Variable]:
    """named: whether the names are ready for the description."""
    scalars = [*scalars]
    starts = np.broadcast_to(start, len(scalars)).tolist()
    missing = start is UNKNOWN
    return [
        Variable(f"{block}.{name if named else _name(name)}", unit, description, True, missing, value)
        for (name, unit), value in zip(scalars, starts, strict=True)
    ]


def _outputs(block: str, scalars: Iterable[tuple[str, str]], description: str, named: bool = False) -> list[Variable]:
    return [Variable(f"{block}.{name if named else _name(name)}", unit, description) for name, unit in scalars]


def _name(name: str) -> str:
    """A structured name of FMI: `tip.x` as it is; what is no identifier, in quotes."""
    plain = re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", name)
    return name if plain else f"'{name}'"
