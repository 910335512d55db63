"""What is said of a walk that did not come to its end."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.control.crawling.course import Course, headline, judged, known
from cfem.core.errors import NumericalError
from cfem.equilibrium.quasi_static import CONVERGED

NAN = float("nan")
ACCOUNT = {"points": {"stick": 4}, "commands": 1, "law_residual": 1e-10}


def test_a_walk_without_an_end_is_said_in_words_and_no_file_gets_nan():
    planned = SimpleNamespace(base=np.zeros((3, 3)), commands=np.zeros((2, 1)), status=CONVERGED)
    fe = SimpleNamespace(base=np.zeros((2, 3)), commands=np.zeros((1, 1)), status="a robot finds no equilibrium")
    far = {"planned": 2.0, "fe": NAN}
    sweep = [{"friction": 0.3, "planned": 1.5, "fe": known(NAN)}]
    alone = [{"friction": 0.1, "planned": known(NAN)}, {"friction": 0.2, "planned": known(1.25)}]
    lines = headline(far, "mm a cycle", sweep, {"planned": planned, "fe": fe}, ACCOUNT, 0.6, 0, alone)
    assert "nan" not in " ".join(lines)
    assert "NOT walked to the end by finite elements (friction 0.6)" in lines[0]
    assert lines[1] == "friction 0.3, a cycle: 1.5 mm planned, no whole cycle by FE"
    assert lines[2].endswith("no whole cycle at 0.1, 1.25 at 0.2")
    assert "4 stick; then: a robot finds no equilibrium; the law is met to 1.0e-10" in lines[-1]
    assert "do not finish the gait" in judged(far, "mm a cycle")[0]["what"]


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
