"""A tube under a braid: its chamber from its lengths, and that it shortens as inextensible threads demand."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[3] / "pipelines" / "mckibben" / "scene.yaml"
ANGLE, RADIUS, FREE = np.radians(25.0), 8.0, 60.0  # of the threads, of the braid, between the plates


def test_it_shortens_as_threads_of_constant_length_demand():
    """Threads at an angle a from the axis: the length goes with cos a, the volume with cos a sin^2 a (Chou and
    Hannaford, IEEE Trans. Robotics Autom. 12, 1996). The wall keeps its volume."""
    scene = load_spec(SCENE, SceneSpec, ["mesh.size=6 mm"])
    mesh, volume = make_mesh(scene, SCENE.parent)
    robot = build_robot(scene, mesh)
    room = np.pi * 6.5**2 * FREE
    assert volume == pytest.approx(np.pi * RADIUS**2 * 70 - room)
    assert 0.9 * room < robot.actuators[0].rest_volume < room  # straight edges on round walls
    within = np.pi * RADIUS**2 * FREE
    state, grown = None, 3000.0
    for share in (0.5, 1.0):
        state = solve(Problem(robot), displacement([share * grown]), base=state and state.state)
        assert state.converged
    braid = np.cos(ANGLE) * np.sin(ANGLE) ** 2
    angle = brentq(lambda a: np.cos(a) * np.sin(a) ** 2 - braid * (1 + grown / within), ANGLE, np.radians(54))
    shortened = FREE * (1 - np.cos(angle) / np.cos(ANGLE))
    assert -state.delta_e[0] == pytest.approx(shortened, rel=0.1)  # plates hold its ends, and edges are straight


def test_lengths_that_do_not_go_together_are_refused():
    with pytest.raises(SpecError, match="the wall must be thinner than the radius, and two plates than the length"):
        load_spec(SCENE, SceneSpec, ["geometry.wall=8 mm"])
