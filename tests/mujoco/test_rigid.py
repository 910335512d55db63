"""How rigid bodies of a MuJoCo model give way, against MuJoCo's own step."""

import mujoco
import numpy as np
import pytest

from cfem.contact.rigid_bodies import motions
from cfem.mujoco.geoms import MM, Geoms
from cfem.mujoco.rigid import Rigid

ARM = """
<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody>
  <body name="upper"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.1 0 0.1" size="0.01" mass="0.1"/>
    <body name="lower" pos="0.1 0 0.1"><joint axis="1 0 1"/><joint type="slide" axis="0 1 0"/>
      <geom type="box" size="0.01 0.02 0.03" pos="0.02 0 0" mass="0.05"/></body></body>
  <body name="free" pos="0.3 0 0"><freejoint/><geom type="ellipsoid" size="0.01 0.02 0.03" mass="0.02"/></body>
  <geom type="plane" size="1 1 1" pos="0 0 -1"/>
</worldbody></mujoco>"""


def test_a_wrench_moves_points_as_a_step_does():
    model = mujoco.MjModel.from_xml_string(ARM)
    data, pushed = mujoco.MjData(model), mujoco.MjData(model)
    rigid = Rigid(model, np.array([2]), Geoms(model, [2]))
    assert (
        rigid.bodies.tolist() == [1, 2, 3] and rigid.robots.tolist() == [1] and rigid.obstacles.tolist() == [-1, 0, 2]
    )
    rng = np.random.default_rng(0)
    mujoco.mj_fwdPosition(model, data)
    rigid.begin(data)
    wrench = rng.normal(size=18) * np.tile([1, 1, 1, 10, 10, 10], 3) * 1e-3
    pushed.qfrc_applied[:] = rigid.joint_forces(wrench)
    begin = data.xpos[rigid.bodies].copy()
    for each in (data, pushed):
        mujoco.mj_step(model, each)
        mujoco.mj_kinematics(model, each)
    assert data.xpos[rigid.bodies] == pytest.approx(begin)
    ahead = rigid.ahead(data, np.zeros(18))
    R, t = motions(ahead.mobility @ wrench, ahead.centres)
    local = np.array([0.01, -0.02, 0.03])
    for i, body in enumerate(rigid.bodies):
        before, after = (each.xpos[body] + each.xmat[body].reshape(3, 3) @ local for each in (data, pushed))
        moved = MM * (after - before)
        assert R[i] @ (MM * before) + t[i] - MM * before == pytest.approx(
            moved, rel=1e-3, abs=1e-3 * np.abs(moved).max()
        )
        (lever,) = ahead.levers(np.array([i]), MM * before[None])
        assert lever @ ahead.mobility @ wrench == pytest.approx(moved, rel=1e-3, abs=1e-3 * np.abs(moved).max())


def test_meshes_are_their_convex_hulls():
    tetrahedron = "0 0 0  0.03 0 0  0 0.03 0  0 0 0.03  0.003 0.003 0.003"
    xml = f'<mujoco><asset><mesh name="m" vertex="{tetrahedron}"/></asset><worldbody><geom type="mesh" mesh="m"/>'
    model = mujoco.MjModel.from_xml_string(xml + "</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    (hull,) = Geoms(model, []).placed(data).obstacles
    points = np.array([[5.0, 5.0, -2.0], [20.0, 20.0, 20.0], [1.0, 8.0, 8.0]])
    assert hull.distance(points) == pytest.approx([2.0, 30.0 / np.sqrt(3), -1.0], abs=1e-4)
