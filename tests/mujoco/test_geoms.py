"""Geoms of MuJoCo as obstacles, against MuJoCo's own rays."""

import mujoco
import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.mujoco.geoms import MM, Geoms

FIELD = """
<mujoco>
  <asset><hfield name="hills" nrow="7" ncol="9" size="0.04 0.03 0.01 0.005"/></asset>
  <worldbody><geom name="ground" type="hfield" hfield="hills" pos="0.01 -0.02 0.03" euler="10 -20 30"/></worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def hills():
    """Model, data and obstacles of hills that are not flat in any cell."""
    model = mujoco.MjModel.from_xml_string(FIELD)
    model.hfield_data[:] = np.random.default_rng(3).random(63)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data, Geoms(model, ())


def test_a_height_field_is_where_rays_hit_it(hills):
    """200 rays along its axis, from above: the surface is there, free above and filled below."""
    model, data, geoms = hills
    R, t = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
    rng, which = np.random.default_rng(4), np.zeros(1, dtype=np.int32)
    within = np.array([0.039, 0.029]) * rng.uniform(-1, 1, (200, 2))
    starts = t + np.column_stack([within, np.full(200, 0.1)]) @ R.T
    gone = np.array([mujoco.mj_ray(model, data, start, -R[:, 2], None, 1, -1, which) for start in starts])
    assert (gone > 0).all()
    hits, (obstacle,) = MM * (starts - gone[:, None] * R[:, 2]), geoms.placed(data).obstacles
    assert np.abs(obstacle.distance(hits)).max() < 1e-6
    assert (obstacle.distance(hits + 0.3 * R[:, 2]) > 0).all() and (obstacle.distance(hits - 0.3 * R[:, 2]) < 0).all()


def test_a_height_field_ends_at_its_base_and_its_sides(hills):
    _, data, geoms = hills
    R, t, (obstacle,) = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0], geoms.placed(data).obstacles
    below, beside = MM * t + R @ [0, 0, -7.0], MM * t + R @ [42.0, 0, -2.0]
    np.testing.assert_allclose(obstacle.distance(np.array([below, beside])), [2.0, 2.0], atol=1e-9)


def test_a_kind_that_is_not_known_is_named():
    model = mujoco.MjModel.from_xml_string(FIELD)
    model.geom_type[0] = mujoco.mjtGeom.mjGEOM_SDF
    with pytest.raises(InputError, match="geom 'ground' is of a kind, sdf, that soft robots do not touch"):
        Geoms(model, ())
