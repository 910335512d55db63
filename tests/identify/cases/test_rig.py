"""From commands to the forces of the drives."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import NumericalError
from cfem.identify.cases.rig import Rig
from cfem.identify.cases.spec import Marker
from cfem.identify.cases.table import Cases


class Number(SimpleNamespace):
    of_scene, session = False, None

    def value(self, z):
        return z


def rig(**numbers):
    """And the forces and the commands before, which its robots are asked for."""
    asked = []

    def at(p, forces, way, case, before):
        asked.append((forces, before))
        return SimpleNamespace(x=np.zeros((1, 3)), turn=np.eye(3)[None])

    unknowns = [Number(keys=(f"drive.a.{part}",)) for part in numbers]
    robots = SimpleNamespace(at=at, rest=np.zeros((1, 3)))
    made = Rig(robots, unknowns, [Marker(effector="e")], ["e"], ["a", "b"], [""], None)
    cases = Cases(
        ("c",), ("",), np.array([[2.0, 1.0]]), np.ones(1), np.zeros((1, 1, 3)), None, (np.array([[1.0, 0.0]]),)
    )
    made.see(cases, np.array(list(numbers.values())), np.zeros(0), slopes=False)
    return asked[0]


def test_a_drive_scales_shifts_and_bulges_commands_now_and_before():
    forces, before = rig(scale=3.0, offset=0.5, limit=4.0)
    np.testing.assert_allclose(forces, [6.5 / (1 - 0.25), 1.0])
    np.testing.assert_allclose(before, [[3.5 / (1 - 1 / 16), 0.0]])


def test_a_chamber_beyond_its_limit_is_told():
    with pytest.raises(NumericalError, match="bulges without bound"):
        rig(limit=1.9)
