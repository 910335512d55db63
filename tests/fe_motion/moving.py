"""Bodies that move: boxes, bars and rods with density and viscosity."""

from dataclasses import replace

import numpy as np
from support.blocks import bar
from support.rods import rod_problem

from cfem.constraint.rod_chambers import make_rod_chambers
from cfem.fe_motion.problem import MovingProblem

DENSITY = 1.1e-9  # t/mm^3


def moving_bar(viscosity=(), free=False, **options):
    """support.blocks.bar with mass; free: held nowhere."""
    robot = replace(bar(**options), density=DENSITY, viscosity=tuple(viscosity))
    return MovingProblem(replace(robot, fixed=np.empty(0, dtype=int)) if free else robot)


def moving_rod(elements, viscosity=(), centres=((0.0, 0.5),), loads=None):
    """support.rods with chambers along it, and mass."""

    def chambers(body):
        return [make_rod_chambers(body.rod, [c], 0.5, np.arange(len(body.rod.length))) for c in centres]

    robot = rod_problem(elements, chambers, loads).robot
    return MovingProblem(replace(robot, density=DENSITY, viscosity=tuple(viscosity)))
