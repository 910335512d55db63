"""`cfem export` with the format fmu on the bar that moves: all four FMUs, and the estimator as in Python."""

from pathlib import Path

import numpy as np
import pytest
from export.embedded import needs_compiler
from export.fmus import Unit
from fmpy.validation import validate_fmu

from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Options
from cfem.export.firmware import swing
from cfem.export.firmware.estimate import firmware_filter, moving_frames, status_of
from cfem.export.firmware.swing import moving_filter_of, swinging_frames
from cfem.export.spec import CSpec, ExportSpec
from cfem.export.stage import run
from cfem.motion.load import load_motion
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model

pytestmark = needs_compiler


@pytest.fixture(scope="module")
def folder(moving_bar):
    return moving_bar / "models" / "bar" / "spectral"


def text_of(folder: Path, dynamics: str = "null", fmu: str = "{}") -> str:
    places = [place.tolist() for place in markers_near(load_model(folder), 4)]
    markers = ", ".join(f"m-{n}: {{mm: {place}}}" for n, place in enumerate(places))
    return (
        f"model: {folder}\nout: out\nformats: [fmu]\nfmu: {fmu}\n"
        f"c: {{vectors: 3, estimate: {{markers: {{{markers}}}, noise: 0.1 mm, rate: 100 Hz, dynamics: {dynamics}, "
        "loads: {rows: [tip.y], largest: 10 mN, lasts: 1 s}, actuators: {displacement: 0.05 mm}}}\n"
    )


def exported(place: Path, text: str) -> tuple[dict[str, Path], dict]:
    (place / "export.yaml").write_text(text)
    manifest = run(place / "export.yaml", [], None, Options())
    return {path.stem: path for path in (place / "out" / "fmu").iterdir()}, manifest["results"]


def compared(
    unit: Unit, frames: list[dict], scale: np.ndarray, rest_e: np.ndarray, known: np.ndarray, tolerance: float
) -> int:
    """Estimates and deviations, to a tolerance of their scale; how many frames none can estimate. known: of the
    unknowns."""
    unit.begin()
    assert np.isnan(unit.get("estimate", "deviation", "position")).all()
    refused = 0
    for one in frames:
        unit.put("marker", one["place"].ravel())
        for name in ("displacement", "force", "command"):
            unit.put(name, one[name])
        unit.step()
        status = status_of(one["answer"].status)
        assert unit.get("status") == [status]
        refused += status > 0
        if not status:
            assert np.abs((unit.get("estimate") - one["x"][known]) / scale[known]).max() < tolerance
            wide = np.sqrt(np.diag(one["covariance"]))[known]
            assert np.abs((unit.get("deviation") - wide) / scale[known]).max() < tolerance
            assert unit.get("position") == pytest.approx(rest_e + one["answer"].delta_e, abs=scale[0] * tolerance)
    return refused


@pytest.mark.slow
def test_all_four_of_a_robot_that_moves(folder, tmp_path):
    text = text_of(folder, "{driven: displacement}")
    fmus, results = exported(tmp_path, text)
    assert set(fmus) == {"controller", "robot", "moving", "estimator"}
    assert not [problem for path in fmus.values() for problem in validate_fmu(str(path))]
    assert not [path for path in (tmp_path / "out").iterdir() if path.name.startswith("tmp")]
    said = results["headline"][-1]
    assert said.startswith("fmu: ") and "estimator.fmu" in said and said.endswith("binaries for x86_64-linux")
    assert results["parity"]["c"] < 1e-10
    unit = Unit(fmus["estimator"], tmp_path, begin=False)
    spec = ExportSpec.model_validate({"model": folder, "out": "out", "c": _c(text)}).c
    still = firmware_filter(spec.estimate, load_model(folder), None)
    made = moving_filter_of(still, spec, load_motion(folder))
    known = np.array([0, made.motion.n_q])
    rest_e = still.estimator.model.rest_e
    compared(unit, swinging_frames(made, 0.01, 30), made.scale, rest_e, known, swing.TOLERANCE)
    unit.close()


def _c(text: str) -> dict:
    from ruamel.yaml import YAML

    return YAML(typ="safe").load(text)["c"]


def test_the_estimator_of_a_robot_at_rest(folder, tmp_path):
    text = text_of(folder, fmu="{parts: [estimator]}")
    fmus, _ = exported(tmp_path, text)
    assert set(fmus) == {"estimator"} and validate_fmu(str(fmus["estimator"])) == []
    made = firmware_filter(CSpec.model_validate(_c(text)).estimate, load_model(folder), None)
    unit = Unit(fmus["estimator"], tmp_path, begin=False)
    one = made.estimator
    assert compared(unit, moving_frames(made), one.scale, one.model.rest_e, np.arange(2), 1e-8) < 10
    unit.close()


def test_a_part_that_cannot_be_is_named(bar, tmp_path):
    spec = f"model: {bar / 'models' / 'bar' / 'spectral'}\nout: out\nformats: [fmu]\n"
    for part, why in (("moving", "the model has not learned to move"), ("estimator", "`c.estimate` says nothing")):
        (tmp_path / "export.yaml").write_text(f"{spec}c: {{vectors: 3}}\nfmu: {{parts: [{part}]}}\n")
        with pytest.raises(InputError, match=rf"fmu\.parts: {part}: {why}"):
            run(tmp_path / "export.yaml", [], None, Options())


def test_obstacles_are_refused(tmp_path):
    plane = "{kind: plane, point: {mm: [0, 0, -90]}, normal: [0, 0, 1]}"
    (tmp_path / "export.yaml").write_text(
        f"model: model\nscene: scene.yaml\nout: out\nformats: [fmu]\nc: {{obstacles: {{table: {plane}}}}}\n"
    )
    with pytest.raises(SpecError, match="obstacles do not go into an FMU yet"):
        run(tmp_path / "export.yaml", [], None, Options())
