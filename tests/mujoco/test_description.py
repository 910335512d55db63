"""A robot as MJCF, which MuJoCo loads and `World` uses."""

import mujoco
import numpy as np
import pytest

import cfem
from cfem.mujoco import World
from cfem.mujoco.description import robot_mjcf

TABLE = """<mujoco><worldbody><geom type="plane" size="1 1 1" pos="0 0 -0.1"/>
<frame name="here"/><body name="there" pos="0 0.2 0" euler="0 0 90"><joint/><geom size="0.01" mass="1" contype="0"
conaffinity="0"/><frame name="there"/></body></worldbody>
</mujoco>"""


@pytest.fixture(scope="module")
def folder(bar):
    """`cfem export` of the bar."""
    out, specs = bar / "models" / "bar" / "mjcf", bar / "pipelines" / "bar"
    (specs / "export-mjcf.yaml").write_text(f"model: ../../models/bar/spectral\nout: {out}\nformats: [mjcf]\n")
    results = cfem.run_stage("export", specs / "export-mjcf.yaml")["results"]
    assert results["headline"][-1].startswith("mjcf: mjcf/robot.xml") and results["parity"] == {}
    return out / "mjcf"


def test_mujoco_reads_skin_effectors_and_ranges(folder, soft_bar):
    learned = soft_bar.surface.model
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    assert model.flex_vertnum[0] == len(learned.skin.rest) and model.flex_elemnum[0] == len(learned.skin.triangles)
    assert 1e3 * model.site("bar.tip").pos == pytest.approx(learned.rest_e, abs=1e-3)
    assert model.actuator("bar.cable").ctrlrange == pytest.approx(learned.reach[0])
    assert model.sensor("bar.force").dim == 3


def test_robots_that_are_attached_obey_their_controls(folder, soft_bar):
    """As they obey commands, and without a second skin."""
    spec = mujoco.MjSpec.from_string(TABLE)
    for place in ("here", "there"):
        spec.attach(mujoco.MjSpec.from_file(str(folder / "robot.xml")), frame=place, prefix=f"{place}/")
    robots = {"here/bar": soft_bar, "there/bar": soft_bar}
    controlled, commanded = World(spec, robots), World(spec, robots)
    assert controlled.model.nflex == 2 and controlled.model.nu == 2
    controlled.data.actuator("here/bar.cable").ctrl = 2.0
    controlled.data.actuator("there/bar.cable").ctrl = 99.0  # as far as it reaches
    states = [
        controlled.step({}),
        commanded.step({"here/bar": [2.0], "there/bar": soft_bar.surface.model.reach[0, 1:]}),
    ]
    assert np.array_equal(states[0].delta_e[0], states[1].delta_e[0]) and states[0].deltas[0] == [2.0]
    assert np.array_equal(states[0].delta_e[1], states[1].delta_e[1])
    assert controlled.step({"here/bar": [1.0]}).deltas[0] == [1.0]
    assert controlled.data.sensor("there/bar.tip").data == pytest.approx(
        np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ (soft_bar.surface.model.rest_e + states[0].delta_e[1]) / 1e3
        + [0, 0.2, 0],
        abs=1e-9,
    )


def test_it_is_written_the_same_each_time(folder, soft_bar):
    assert (folder / "robot.xml").read_text() == robot_mjcf(soft_bar.surface.model)
