"""The linear motion against solved equilibria of a small reach."""

import numpy as np
from robot.scenes import scene

from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.checks.stroke import linear_motion
from cfem.robot.mesh.meshing import make_mesh


def test_a_small_reach_moves_as_far_as_a_solve_says(tmp_path):
    cable = "[{kind: cable, name: %s, points: {mm: [[5, 0, %s], [25, 0, %s]]}, reach: {mm: [0, 3]}}]"
    pair = f"{(cable % ('up', 3, 3))[:-1]}, {(cable % ('low', -2, -3))[1:]}"
    own = scene(tmp_path, actuators=pair)
    robot = build_robot(own, make_mesh(own, tmp_path)[0])
    by_displacement, by_force = linear_motion(robot)
    problem, step = Problem(robot), 1e-5
    for index in range(2):
        found = solve(problem, force(np.eye(2)[index] * step))
        moved = np.linalg.norm(found.state.x - robot.X, axis=1).max()
        np.testing.assert_allclose(moved / step, by_force[index], rtol=1e-3)
        np.testing.assert_allclose(found.delta_a[index], step * by_force[index] / by_displacement[index], rtol=1e-3)
