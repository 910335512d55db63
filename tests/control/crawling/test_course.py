"""What is said of a walk that did not come to its end."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.contact.law.modes import Mode
from cfem.control.crawling.course import Course, account_of, headline, judged, known
from cfem.control.crawling.crawler import Walk
from cfem.control.crawling.gait import Gait
from cfem.core.errors import NumericalError
from cfem.equilibrium.quasi_static import CONVERGED

NAN = float("nan")
ACCOUNT = {"points": {"stick": 4}, "commands": 1, "law_residual": 1e-10}


def test_a_walk_without_an_end_is_said_in_words_and_no_file_gets_nan():
    planned = SimpleNamespace(base=np.zeros((3, 3)), commands=np.zeros((2, 1)), status=CONVERGED)
    fe = SimpleNamespace(base=np.zeros((2, 3)), commands=np.zeros((1, 1)), status="a robot finds no equilibrium")
    far = {"planned": 2.0, "half_steps": NAN, "fe": NAN}
    sweep = [{"friction": 0.3, "planned": 1.5, "half_steps": 1.6, "fe": known(NAN)}]
    gone = (0.1, NAN, NAN), (0.2, 1.25, 1.1), (0.3, 1.25, 0.05), (0.4, 1.0, NAN)
    alone = [{"friction": mu, "planned": known(far), "half_steps": known(halved)} for mu, far, halved in gone]
    lines = headline(far, "mm a cycle", sweep, {"planned": planned, "fe": fe}, ACCOUNT, 0.6, 0, alone)
    assert "nan" not in " ".join(lines)
    assert "NOT walked to the end by finite elements (friction 0.6)" in lines[0]
    assert lines[1] == "friction 0.3, a cycle: 1.5 mm planned, no whole cycle by FE"
    assert lines[2].endswith(
        "no whole cycle at 0.1, 1.25 at 0.2, 1.25 (in half steps 0.05) at 0.3, 1 (in half steps no whole cycle) at 0.4"
    )
    assert "4 stick; then: a robot finds no equilibrium; the law is met to 1.0e-10" in lines[-1]
    assert "do not finish the gait" in judged(far | {"half_steps": 2.0}, "mm a cycle")[0]["what"]


class Strider:
    """Goes 3 mm along y, and 1 mm back along x, at each command, until it is told that it is there."""

    centre = np.array([5.0, 10.0, 0.0])

    def __init__(self, most=1000):
        self.most = most

    def walk(self, u, friction, there):
        base, done = self.centre.copy(), 0
        while done < min(len(u), self.most) and not there(base):
            base, done = base + [-1.0, 3.0, 0.0], done + 1
        travelled = base - self.centre
        return SimpleNamespace(
            status=CONVERGED, commands=u[:done], travelled=lambda direction: float(travelled @ direction)
        )


def course(distance):
    ground = SimpleNamespace(friction=0.5)
    spec = SimpleNamespace(
        direction=[0.0, 2.0, 0.0], distance=distance, pulls=np.array([0.0, 5.0]), steps=4, ground=ground
    )
    return Course(spec, (False,), 1)


def test_a_stated_distance_ends_the_walk_and_one_that_is_not_gone_is_an_error(monkeypatch):
    monkeypatch.setattr("cfem.control.crawling.course.commands_of", lambda *arguments: np.zeros((400, 1)))
    walk = course(30.0).plan(Strider(), None)
    assert walk.travelled(np.array([0.0, 1.0, 0.0])) == 30.0 and len(walk.commands) == 10
    with pytest.raises(NumericalError, match="the gait goes 27 mm in 100 cycles, not 30 mm"):
        course(30.0).plan(Strider(most=9), None)


class Rower:
    """Goes 2 mm a cycle along y for each share of the first mean beyond 0.25, and pushes with what the second lacks."""

    def __init__(self, good=1.0):
        self.good, self.asked = good, []

    def walk(self, u, friction):
        self.asked.append((len(u), friction))
        far = self.good * 2.0 * (u[:, 0].mean() / 5.0 - 0.25)
        base = np.outer(np.arange(len(u) + 1) / 4, [0.0, far, 0.0])
        least = np.minimum(u[:, 1].mean() / 5.0 - 0.1, 0.5)
        return Walk(u, base, np.tile(np.eye(3), (len(u) + 1, 1, 1)), np.full(len(u), least), (), np.zeros(0), CONVERGED)


def rowing():
    ground = SimpleNamespace(friction=0.5)
    spec = {"direction": [0.0, 2.0, 0.0], "distance": None, "pulls": [0.0, 5.0], "steps": 4, "cycles": 3}
    return Course(SimpleNamespace(**spec, ground=ground, evaluations=24), (False,), 2)


def test_the_best_gait_is_the_one_that_goes_farthest_of_few_cycles_each():
    rower, course = Rower(), rowing()
    best = course.best(rower)
    far, least = course.tried(rower, best)
    assert {*rower.asked} == {(2 * 4, 0.5)} and 24 <= len(rower.asked) <= 27
    shares = best.leg(4)
    assert far == pytest.approx(2 * (shares[:, 0].mean() - 0.25)) and far > 0.8
    assert least == pytest.approx(min(0.0, shares[:, 1].mean() - 0.1))


def test_the_smallest_force_of_a_gait_that_only_pulls_is_none():
    idle = Gait(np.array([0.5, 0.05]), np.zeros(2), np.zeros(2))
    far, least = rowing().tried(Rower(), idle)
    assert far == pytest.approx(0.5) and least == pytest.approx(-0.05)
    assert rowing().tried(Rower(), Gait(np.full(2, 0.5), np.zeros(2), np.zeros(2)))[1] == 0.0


def test_a_crawler_that_no_gait_carries_along_is_refused():
    with pytest.raises(NumericalError, match="none of 24 gaits carries the crawler along"):
        rowing().best(Rower(good=0.0))


def test_contact_points_are_counted_by_mode_and_the_worst_residual_is_told():
    touches = [
        SimpleNamespace(modes=(Mode.STICK, Mode.OPEN, Mode.STICK), check=SimpleNamespace(largest=1e-9)),
        SimpleNamespace(modes=(Mode.SLIP, Mode.OPEN, Mode.STICK), check=SimpleNamespace(largest=3e-9)),
    ]
    walk = SimpleNamespace(touches=touches, commands=[None] * 2, status=CONVERGED)
    assert account_of(walk) == {
        "commands": 2, "points": {"stick": 3, "open": 2, "slip": 1}, "law_residual": 3e-9, "status": CONVERGED
    }  # fmt: skip
    empty = SimpleNamespace(touches=[], commands=[], status="no")
    assert account_of(empty) == {"commands": 0, "points": {}, "law_residual": 0.0, "status": "no"}


def test_a_distance_a_cycle_leaves_out_the_first_and_needs_another():
    base = np.outer([0.0, 5.0, 6.0, 7.5, 9.0, 99.0], [0.0, 1.0, 0.0])
    along = np.array([0.0, 1.0, 0.0])
    walk = Walk(np.zeros((5, 1)), base, np.zeros(0), np.zeros(0), (), np.zeros(0), CONVERGED)
    assert walk.per_cycle(2, along) == 9.0 - 6.0 and walk.per_cycle(1, along) == (99.0 - 5.0) / 4
    assert np.isnan(walk.per_cycle(3, along)) and np.isnan(replace(walk, status="no").per_cycle(2, along))
    assert walk.travelled(along) == 99.0 and np.isnan(replace(walk, status="no").travelled(along))
