"""`cfem estimate` on a recording that the model itself made, and what it says of recordings that are wrong."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import cfem
from cfem.core.errors import InputError, SpecError
from cfem.motion.estimation.moving_markers import MovingMarkers
from cfem.motion.load import load_motion
from cfem.motion.step import MotionCommand, at_rest, step
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model

NAMES = ("m1", "m2", "m3", "m4", "m5")
FRAMES = 60


@pytest.fixture(scope="module")
def recorded(bar, tmp_path_factory):
    """A folder with estimate.yaml, its recording and the truth."""
    folder, model = tmp_path_factory.mktemp("estimate"), load_model(bar / "models" / "bar" / "spectral")
    places, rng = markers_near(model, 5), np.random.default_rng(0)
    estimator = Estimator(model, places, 0.1, ("tip.y", "tip.z"), 0.02)
    lines = ["time [s]," + ",".join(f"{name}.{a} [mm]" for name in NAMES for a in "xyz")
             + ",cable.displacement [mm],cable.force [N],cable.command [mm]"]  # fmt: skip
    truth = ["cable.displacement [mm],tip.y.force [mN],tip.z.force [mN]"]
    for frame in range(FRAMES):
        u = 2.0 + 0.04 * frame
        x = np.array([u, 0.012, -0.006])
        seen = estimator.places(x) + 0.1 * rng.normal(size=(5, 3))
        force = estimator.tensions(x)[0] + 0.02 * rng.normal()
        cells = [f"{number:.5f}" for number in seen.ravel()]
        if frame == 30:
            cells[3:6] = ["", "", ""]
        lines.append(f"{0.1 * frame:.2f},{','.join(cells)},{u + 0.05 * rng.normal():.4f},{force:.5f},{u:.4f}")
        truth.append(f"{u},12,-6")
    (folder / "recording.csv").write_text("\n".join(lines))
    (folder / "truth.csv").write_text("\n".join(truth))
    markers = "".join(f"  {name}: {{mm: {place.tolist()}}}\n" for name, place in zip(NAMES, places, strict=True))
    (folder / "estimate.yaml").write_text(
        f"model: {bar / 'models' / 'bar' / 'spectral'}\nrecording: recording.csv\nout: found\nmarkers:\n{markers}"
        "noise: 0.1 mm\nloads: {rows: [tip.y, tip.z], largest: 20 mN, lasts: 60 s}\n"
        "actuators: {displacement: 0.05 mm, force: 20 mN}\ntruth: truth.csv\n"
    )
    return folder


def test_a_recording_becomes_a_table_of_estimates(recorded):
    manifest = cfem.run_stage("estimate", recorded / "estimate.yaml")
    results = manifest["results"]
    assert results["frames"] == results["estimated"] == FRAMES and "judgement" not in results
    assert 0.9 < results["noise_ratio"] < 1.1
    assert all(one["covered"] > 0.8 for one in results["truth"].values())
    least = results["push"]["least_error"]
    assert 0.02 < least < 0.6 and any("60 frames tell such a push" in line for line in manifest["results"]["headline"])
    table = pq.read_table(recorded / "found" / "estimates.parquet")
    meta = json.loads(table.schema.metadata[b"cfem"])
    assert meta["loaded"] == ["tip.y", "tip.z"] and meta["units"]["loads"] == "N"
    assert table.num_rows == FRAMES and abs(table["delta_a"][-1].as_py()[0] - 4.36) < 0.1
    assert cfem.run_stage("estimate", recorded / "estimate.yaml")["status"] == "up to date"


def test_each_frame_alone_is_less_certain(recorded):
    together = pq.read_table(recorded / "found" / "estimates.parquet")["loads_sd"][-1].as_py()
    cfem.run_stage("estimate", recorded / "estimate.yaml", overrides=["each_frame=true"], out=recorded / "alone")
    alone = pq.read_table(recorded / "alone" / "estimates.parquet")["loads_sd"][-1].as_py()
    assert (np.array(together) < np.array([0.85, 0.6]) * np.array(alone)).all()


def test_a_marker_at_the_wrong_place_is_called_so_first(recorded):
    text = (recorded / "estimate.yaml").read_text()
    line = next(one for one in text.splitlines() if one.startswith("  m3:"))
    x, y, z = json.loads(line.partition("mm: ")[2].rstrip("}"))
    moved = recorded / "moved.yaml"
    moved.write_text(text.replace(line, f"  m3: {{mm: [{x - 4.0}, {y}, {z}]}}"))
    results = cfem.run_stage("estimate", moved, out=recorded / "moved")["results"]
    assert "marker m3 was left out" in results["judgement"][0]["what"]


def test_a_noise_that_is_far_too_small_is_called_so_first(recorded):
    overrides = ["noise=0.01 mm"]
    results = cfem.run_stage("estimate", recorded / "estimate.yaml", overrides=overrides, out=recorded / "quiet")[
        "results"
    ]
    said = results["judgement"][0]["what"]
    assert "frames have no estimate: half of the markers do not fit" in said and "look at their noise" in said
    assert not [line for line in results["headline"] if "nan" in line]


def test_forces_are_those_of_the_last_frame_that_has_an_estimate(recorded, tmp_path):
    lines = (recorded / "recording.csv").read_text().splitlines()
    table, spec = "recording.csv", (recorded / "estimate.yaml").read_text().replace("truth: truth.csv\n", "")
    (tmp_path / "estimate.yaml").write_text(spec)
    cells = [line.split(",") for line in lines[1:]]
    strange = [",".join([row[0], *row[4:16], *row[1:4], *row[16:]]) for row in cells]  # each marker where another is
    for rows, said in ((lines[1:-5] + strange[-5:], f"in frame {FRAMES - 5}, the last that has"), (strange, None)):
        (tmp_path / table).write_text("\n".join([lines[0], *rows]))
        results = cfem.run_stage("estimate", tmp_path / "estimate.yaml", force=True)["results"]
        forces = [line for line in results["headline"] if line.startswith("tip.")]
        assert all(said in line for line in forces) and len(forces) == (2 if said else 0)


@pytest.mark.parametrize(
    ("change", "said", "code"),
    [
        (("m5.z [mm]", "m6.z [mm]"), "column 'm6.z'", 3),
        (("0.30,", "0.10,"), "recording.csv:5: 'time' does not increase", 3),
        (("time [s]", "time [mm]"), "'mm' is not a unit of time", 3),
        (("cable.force [N]", "cable.force [mm]"), "'mm' is not a unit of force", 3),
    ],
)
def test_a_wrong_recording_gets_one_sentence(recorded, tmp_path, change, said, code):
    table, spec = (recorded / "recording.csv").read_text(), (recorded / "estimate.yaml").read_text()
    (tmp_path / "recording.csv").write_text(table.replace(*change, 1))
    (tmp_path / "truth.csv").write_text((recorded / "truth.csv").read_text())
    (tmp_path / "estimate.yaml").write_text(spec)
    with pytest.raises(cfem.InputError, match=said) as error:
        cfem.run_stage("estimate", tmp_path / "estimate.yaml")
    assert error.value.exit_code == code and "recording.csv" in str(error.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("rows: [tip.y, tip.z]", "rows: [top.y]"), "no row 'top.y'"),
        (("actuators: {displacement: 0.05 mm, force: 20 mN}", "actuators: {force: 20 mN}"), "noise is missing"),
        (("noise: 0.1 mm", "noise: 0 mm"), "greater than 0"),
        (("displacement: 0.05 mm", "displacement: 50 mm^3"), "mm"),
    ],
)
def test_a_wrong_spec_gets_one_sentence(recorded, change, said):
    wrong = recorded / "wrong.yaml"
    wrong.write_text((recorded / "estimate.yaml").read_text().replace(*change, 1))
    with pytest.raises(cfem.CfemError, match=said):
        cfem.run_stage("estimate", wrong, out=recorded / "wrong")


@pytest.fixture(scope="module")
def ringing(moving_bar, tmp_path_factory):
    """A folder with estimate.yaml and a recording of a bar that rings after a pull, by its own model."""
    folder, trained = tmp_path_factory.mktemp("ringing"), moving_bar / "models" / "bar" / "spectral"
    model, motion, rng = load_model(trained), load_motion(trained), np.random.default_rng(0)
    places = markers_near(model, 5)
    estimator = Estimator(model, places, 0.1, ("tip.y", "tip.z"), 0.02)
    markers, now = MovingMarkers(estimator, motion), at_rest(motion, np.array([2.0]))
    lines = ["time [s]," + ",".join(f"{name}.{a} [mm]" for name in NAMES for a in "xyz") + ",cable.command [mm]"]
    for frame in range(40):
        u = 2.0 if frame < 3 else 3.0
        for _ in range(4):
            now = step(motion, now, MotionCommand(displacement=np.array([u])), 5e-4)
        seen = estimator.rest + markers.seen(np.r_[now.q, 0.0, 0.0, 0.0])[0].reshape(-1, 3)
        seen += 0.1 * rng.normal(size=(5, 3))
        lines.append(f"{0.002 * frame:.4f},{','.join(f'{one:.5f}' for one in seen.ravel())},{u}")
    (folder / "recording.csv").write_text("\n".join(lines))
    marked = "".join(f"  {name}: {{mm: {place.tolist()}}}\n" for name, place in zip(NAMES, places, strict=True))
    (folder / "estimate.yaml").write_text(
        f"model: {trained}\nrecording: recording.csv\nout: found\nmarkers:\n{marked}"
        "noise: 0.1 mm\nloads: {rows: [tip.y, tip.z], largest: 20 mN}\ndynamics: {}\n"
    )
    return folder


def test_a_recording_of_what_rings(ringing):
    """With dynamics, each frame is as the one before led to expect; at rest, markers do not fit."""
    moving = cfem.run_stage("estimate", ringing / "estimate.yaml")["results"]
    assert moving["estimated"] == 40 and 0.7 < moving["innovation"] < 1.3 and "judgement" not in moving
    still = cfem.run_stage("estimate", ringing / "estimate.yaml", overrides=["dynamics=null"], out=ringing / "still")
    assert still["results"]["estimated"] < 40
    assert any("of a robot that moves from frame to frame" in line for line in still["results"]["headline"])


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("actuators={force: 20 mN}", "load cells measure inertia as well"),
        ("dynamics={driven: force}", "not a unit of force"),
        ("each_frame=true", "leave out each_frame"),
    ],
)
def test_what_dynamics_do_not_take_is_refused(ringing, tmp_path, override, said):
    with pytest.raises((InputError, SpecError), match=said):
        cfem.run_stage("estimate", ringing / "estimate.yaml", overrides=[override], out=tmp_path / "out")


def test_dynamics_driven_by_forces_need_them(ringing, tmp_path):
    text = (ringing / "recording.csv").read_text()
    (tmp_path / "bare.csv").write_text("\n".join(line.rpartition(",")[0] for line in text.splitlines()))
    with pytest.raises(InputError, match="lacks commanded forces"):
        overrides = [f"recording={tmp_path / 'bare.csv'}", "dynamics={driven: force}"]
        cfem.run_stage("estimate", ringing / "estimate.yaml", overrides=overrides, out=tmp_path / "out")


def test_dynamics_need_times(ringing, tmp_path):
    text = (ringing / "recording.csv").read_text()
    (tmp_path / "timeless.csv").write_text("\n".join(line.partition(",")[2] for line in text.splitlines()))
    with pytest.raises(InputError, match="no column 'time"):
        overrides = [f"recording={tmp_path / 'timeless.csv'}"]
        cfem.run_stage("estimate", ringing / "estimate.yaml", overrides=overrides, out=tmp_path / "out")
