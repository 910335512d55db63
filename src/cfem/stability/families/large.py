"""A body of 1e5 linear tetrahedra."""

from cfem.core.system import peak_memory
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.stability.bodies import SOFT, box, cable, robot, watched
from cfem.stability.case import Case, converges
from cfem.stability.examine import attempt

DIVISIONS = (58, 17, 17)  # cubes of six tetrahedra: 100 572
MOST_MEMORY = 8.0  # GiB


def cases() -> list[Case]:
    return [
        Case("large/1e5 linear tetrahedra", converges(also=_memory), attempt(_block, displacement([2.0])), heavy=True)
    ]


def _memory(trial) -> str | None:
    held = peak_memory()
    return None if held is None or held <= MOST_MEMORY else f"it took {held:.1f} GiB, more than {MOST_MEMORY:g}"


def _block() -> Robot:
    mesh = box((60.0, 17.5, 17.5), DIVISIONS, "tet4")
    pulled = cable(mesh, [(x, 8.0, 2.0) for x in (15.0, 35.0, 55.0)], (0.0, 8.0, 2.0))
    return robot(make_body(mesh, ELEMENTS["tet4"], SOFT), [pulled], [watched(mesh, (60.0, 8.0, 8.0))])
