"""By how much the learned robot's answers to the commands of a run change in shorter steps. With friction it goes from
command to command in quasi-static steps, as finite elements do, and both depend on the length of these."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, takewhile
from typing import Any

import numpy as np

from cfem.control.holding.gripping import Gripping
from cfem.core.artefact.judgement import poor
from cfem.core.console.progress import doing
from cfem.core.console.shown import length
from cfem.core.errors import NumericalError
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.plant.grip_plant import GripPlant
from cfem.predict.contact.model import ContactModel

SHORTER = 8  # times
APART = 0.2  # of the largest force: a change that makes a run poor
FAR = 0.01  # of the length: the same of the tip
THING = "the object"


@dataclass(frozen=True)
class StepDependence:
    """What steps that are SHORTER times shorter change at the goals, at most; infinite where they lead to no state.

    force: N, of the force of any obstacle that has one
    tip: mm, of all effector points together
    pressed: N, the largest force
    of: what these points are of, in words"""

    force: float
    tip: float
    pressed: float
    of: str = "the tip"

    def results(self) -> dict[str, float | None]:
        """Values for a results file, None for infinite ones."""
        values = {"force": self.force, "tip": self.tip, "pressed": self.pressed}
        return {name: value if np.isfinite(value) else None for name, value in values.items()}

    def sentence(self, name: str) -> str:
        """Sentence for people about the model of this name."""
        if not np.isfinite(self.tip):
            return f"friction: by {name}, steps {SHORTER} times shorter do NOT lead to the same goals: no contact state"
        force = f"forces of obstacles by {self.force:.2g} N and " if self.pressed else ""
        return (
            f"friction: steps {SHORTER} times shorter change {force}{self.of} by {length(self.tip)} at most, by {name}"
        )

    def judged(self, robot_length: float) -> list[dict[str, Any]]:
        """Findings about a robot of this length (mm): POOR where the answers depend on the steps."""
        if self.force <= APART * self.pressed and self.tip <= FAR * robot_length:
            return []
        return [poor(f"the plan depends on the length of its steps, as friction does: {self.sentence('the model')}")]


def step_dependence(model: ContactModel, rows: Sequence[Mapping[str, Any]]) -> StepDependence | None:
    """Changes by shorter steps after the commands in the rows of one controller; None without friction."""
    if not model.kinked or not rows:
        return None
    doing(f"walking {len(rows)} commands in shorter steps")
    whole, shorter = (list(_answers(each, rows)) for each in (model, replace(model, step=model.step / SHORTER)))
    if len(whole) < len(rows) or len(shorter) < len(rows):
        return StepDependence(np.inf, np.inf, 0.0)
    changed, forces = np.array(shorter) - whole, np.array([name.endswith(".force") for name in model.rows.effectors])
    points = ~np.array(model.rows.turns)
    points[len(model.patched.model.rest_e) :] = False
    return StepDependence(
        float(np.abs(changed[:, forces]).max(initial=0.0)),
        float(np.linalg.norm(changed[:, points], axis=1).max()),
        float(np.abs(np.array(whole)[:, forces]).max(initial=0.0)),
    )


def step_dependence_of_grip(model: Gripping, rows: Sequence[Mapping[str, Any]]) -> StepDependence | None:
    """Changes by shorter steps of the place of an object that robots hold, up to where they let it go; None without
    commands."""
    commands = list(takewhile(np.any, (np.array(row["delta_a"]) for row in rows)))
    if not commands:
        return None
    doing(f"walking {len(commands)} commands in shorter steps")
    whole, shorter = (list(_places(model.grip.restarted(share), commands)) for share in (1.0, 1 / SHORTER))
    if len(whole) < len(commands) or len(shorter) < len(commands):
        return StepDependence(0.0, np.inf, 0.0, THING)
    return StepDependence(0.0, float(np.linalg.norm(np.array(shorter) - whole, axis=1).max()), 0.0, THING)


def _places(grip: GripPlant, commands: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
    """Places (3,) mm of the object after each command, as far as there are contact states."""
    status = grip.grasp()
    for delta_a in commands:
        status = grip.towards(delta_a) if status == CONVERGED else status
        if status != CONVERGED:
            return
        yield grip.effectors()[:3]


def _answers(model: ContactModel, rows: Sequence[Mapping[str, Any]]) -> Iterator[np.ndarray]:
    """Effector rows (n_e,) after each command, as far as there are contact states."""
    for _, trajectory in groupby(rows, key=lambda row: row["trajectory"]):
        commands = [np.array(row["delta_a"]) for row in trajectory]
        shares = np.linspace(0.0, 1.0, len(commands)) if len(commands) > 1 else np.zeros(1)
        walker = model.standing(0.0)
        for delta_a, share in zip(commands, shares, strict=True):
            try:
                walker.pass_to(share)
                walker.settle(delta_a)
                effectors = walker.at_displacement(delta_a).delta_e
            except NumericalError:
                return
            yield effectors
