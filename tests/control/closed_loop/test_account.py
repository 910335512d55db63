from types import SimpleNamespace

import numpy as np
import pytest

from cfem.control.closed_loop.account import over_time, saturation
from cfem.control.search.inverse import Limits


def run(errors, commands, softened=False, astray=False):
    return [
        SimpleNamespace(error=e, belief=SimpleNamespace(u=np.array(u, float), softened=softened, astray=astray))
        for e, u in zip(errors, commands, strict=True)
    ]


def test_errors_of_each_tenth():
    runs = [run(np.arange(20.0), [[0]] * 20), run(np.arange(20.0) + 1, [[0]] * 20)]
    found = over_time(runs, 10.0)
    assert [one["until"] for one in found] == pytest.approx(0.2 * np.arange(1, 11))
    assert found[0] == {"until": 0.2, "mean": 1.0, "max": 2.0} and found[9]["max"] == 20
    lost = over_time([run([np.nan] * 4, [[0]] * 4)], 1.0)
    assert lost[0]["mean"] is None and len(lost) == 4


def test_shares_of_the_ticks_at_bounds():
    limits = Limits(np.array([[0.0, 5.0], [0.0, 5.0]]), np.zeros((2, 2)))
    pilot = SimpleNamespace(limits=limits, command="force", rate=2.0)
    commands = [[1, 1], [3, 1], [5, 2], [5, 2]]
    found = saturation([run([0] * 4, commands)], pilot, ["left", "right"])
    assert found == {"left: largest": 0.5, "left: rate": 0.5}
    assert saturation([run([0], [[0, 1]], True)], pilot, ["left", "right"]) == {
        "left: smallest": 1.0,
        "bounds on the robot missed": 1.0,
    }
    lost = saturation([run([0, 0], [[1, 1], [1, 1]], astray=True)], pilot, ["left", "right"])
    assert lost == {"the robot does not move as the model says": 1.0}
