"""By how much answers to the commands of a run change in shorter steps."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.condensed import Rows
from cfem.control.task.obstacles.shorter_steps import (
    SHORTER,
    StepDependence,
    step_dependence,
    step_dependence_of_grip,
)
from cfem.core.errors import NumericalError

ROWS = Rows(("tip.x", "tip.y", "ball.force", "table.distance"), ("cable",))


@dataclass
class Rubbed:
    """A robot whose error is the length of its steps times the sum of its command and of the share of the run."""

    step: float = 0.1
    kinked: bool = True
    ends: float = np.inf  # mm of the cable, from where no state is found in short steps
    rows: Rows = ROWS
    at: list[float] = field(default_factory=list)

    @property
    def patched(self):
        return SimpleNamespace(model=SimpleNamespace(rest_e=np.zeros(2)))

    def standing(self, share):
        self.at = [share]
        return self

    def pass_to(self, share):
        self.at.append(share)

    def settle(self, delta_a):
        if self.step < 0.1 and delta_a[0] >= self.ends:
            raise NumericalError("no state")

    def at_displacement(self, delta_a):
        off = self.step * (delta_a[0] + self.at[-1])
        return SimpleNamespace(delta_e=np.array([3 * off, 4 * off, 0.2 + off, 100 * off]))


COMMANDS = [{"trajectory": name, "delta_a": [value]} for name, value in (("a", 1.0), ("a", 2.0), ("b", 1.5))]


def test_changes_are_of_forces_and_of_all_effector_points_together():
    found = step_dependence(Rubbed(), COMMANDS)
    change = 0.1 * (1 - 1 / SHORTER) * (2.0 + 1.0)  # the second command is the end of its trajectory
    assert (found.force, found.tip, found.pressed) == pytest.approx((change, 5 * change, 0.5))
    assert found.results() == {"force": found.force, "tip": found.tip, "pressed": found.pressed}
    assert found.sentence("m").endswith("change forces of obstacles by 0.26 N and the tip by 1.31 mm at most, by m")


def test_nothing_is_said_without_friction_or_commands():
    assert step_dependence(Rubbed(kinked=False), COMMANDS) is None
    assert step_dependence(Rubbed(), []) is None


def test_commands_that_shorter_steps_do_not_carry_out_are_poor():
    found = step_dependence(Rubbed(ends=2.0), COMMANDS)
    assert found.results()["tip"] is None
    assert "do NOT lead to the same goals" in found.sentence("m")
    assert "do NOT lead" in found.judged(100.0)[0]["what"]


@pytest.mark.parametrize(("force", "tip", "poor"), [(0.1, 0.9, 0), (0.21, 0.0, 1), (0.0, 1.1, 1)])
def test_a_fifth_of_the_force_or_a_hundredth_of_the_length_is_poor(force, tip, poor):
    assert len(StepDependence(force, tip, 1.0).judged(100.0)) == poor


def test_without_a_force_only_the_tip_is_told():
    assert "forces" not in StepDependence(0.0, 0.1, 0.0).sentence("m")


class Rubbing:
    """Robots that drag their object by the length of their steps times their command, and end beyond 3 mm."""

    def __init__(self, longest=0.1, ends=3.0):
        self.longest, self.ends, self.at = longest, ends, 0.0

    def restarted(self, share):
        return Rubbing(share * self.longest, self.ends)

    def grasp(self):
        return "converged"

    def towards(self, delta_a):
        self.at = delta_a[0]
        return "converged" if self.at < self.ends or self.longest == 0.1 else "no state"

    def effectors(self):
        return np.array([3.0, 4.0, 0.0, 7.0]) * self.longest * self.at


def test_changes_of_a_held_object_are_of_its_place_until_it_is_let_go():
    rows = [{"delta_a": [value]} for value in (1.0, 2.0, 0.0, 9.0)]
    found = step_dependence_of_grip(SimpleNamespace(grip=Rubbing()), rows)
    assert found.tip == pytest.approx(5 * 0.1 * (1 - 1 / SHORTER) * 2.0)
    assert found.sentence("m") == "friction: steps 8 times shorter change the object by 0.875 mm at most, by m"
    assert len(found.judged(80.0)) == 1 and not found.judged(90.0)
    lost = step_dependence_of_grip(SimpleNamespace(grip=Rubbing(ends=2.0)), rows)
    assert np.isinf(lost.tip) and lost.results()["tip"] is None and lost.judged(1e6)
    assert step_dependence_of_grip(SimpleNamespace(grip=Rubbing()), rows[2:]) is None
