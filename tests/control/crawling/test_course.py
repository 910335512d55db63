"""What is said of a walk that did not come to its end."""

from types import SimpleNamespace

import numpy as np

from cfem.control.crawling.course import headline, judged, known
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
    assert "do not finish the gait" in judged(far, "mm a cycle")[0]["what"]
