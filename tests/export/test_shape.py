"""The whole surface in every format, against the trained skin; and none where nobody asks for it."""

import shutil
import subprocess

import numpy as np
import pytest

import cfem
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError
from cfem.export.compiled.shape import CompiledShape
from cfem.export.firmware.skin import write_c_skin
from cfem.export.spec import CSpec
from cfem.predict.loads.loaded import loaded

STATES = np.array([[0.0], [1.7], [7.9]])
needs_compiler = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")


def export(bar, out, *overrides):
    words = ["shape=true", *overrides]
    return cfem.run_stage("export", bar / "pipelines" / "bar" / "export.yaml", out=out, overrides=words)


@needs_compiler
def test_every_format_has_the_shape_of_the_trained_model(bar, model, tmp_path):
    pytest.importorskip("torch")
    results = export(bar, tmp_path / "all", "formats=[arrays, onnx, torchscript, c]")["results"]
    shapes = {name: value for name, value in results["parity"].items() if name.endswith("shape")}
    assert set(shapes) == {"onnx shape", "torchscript shape", "c shape"} and max(shapes.values()) < 1e-12
    exported = cfem.load_model(tmp_path / "all")
    np.testing.assert_array_equal(exported.shape(STATES), model.shape(STATES))
    by_onnx = cfem.load_model(tmp_path / "all", "onnx")
    np.testing.assert_allclose(by_onnx.shape(STATES), model.shape(STATES), atol=1e-12)
    compiled = CompiledShape(tmp_path / "all" / "c")
    np.testing.assert_allclose([compiled(one) for one in STATES], model.shape(STATES), atol=1e-10)
    subprocess.run(["make", "-s", "libcfem.a"], cwd=tmp_path / "all" / "c", check=True, capture_output=True)


@needs_compiler
def test_single_precision_and_warnings(bar, model, tmp_path):
    results = export(bar, tmp_path / "float", "formats=[c]", "c.scalar=float")["results"]
    assert results["parity"]["c shape"] < 1e-6
    strict = ("-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic")
    np.testing.assert_allclose(CompiledShape(tmp_path / "float" / "c", strict)([3.0]), model.shape([3.0]), atol=1e-4)


def test_without_being_asked_no_format_has_it_and_arrays_keep_the_skin(bar, tmp_path):
    out = tmp_path / "plain"
    cfem.run_stage("export", bar / "pipelines" / "bar" / "export.yaml", out=out, overrides=["formats=[arrays, c]"])
    files = set(read_manifest(out)["files"])
    assert "skin.npz" in files and not {name for name in files if "shape" in name or "cfem_skin" in name}


def test_a_model_without_a_skin_says_what_to_do(bar, tmp_path):
    plain = tmp_path / "plain"
    cfem.run_stage("train", bar / "pipelines" / "bar" / "train.yaml", out=plain, overrides=["skin=false"])
    with pytest.raises(InputError, match="has no skin, and so no shape"):
        export(bar, tmp_path / "out", f"model={plain}", "formats=[arrays]")


def test_a_load_moves_the_surface_as_finite_elements_say(bar, model):
    """A force at the tip, small against what bends the bar, added to the scene."""
    overrides = ["loads=[{point: {mm: [59, 0, 0]}, force: {mN: [0, 0.4, 0]}}]"]
    scene, mesh = bar / "pipelines" / "bar" / "scene.yaml", bar / "data" / "bar" / "mesh"
    free, pushed = cfem.load_robot(scene, mesh), cfem.load_robot(scene, mesh, overrides=overrides)
    nodes = model.skin.nodes
    x = [cfem.solve(one, displacement=[3.0]).state.x[nodes] for one in (free, pushed)]
    moved = loaded(model, np.array([0.0, 4e-4, 0.0])).shape([3.0]) - model.shape([3.0])
    largest = np.linalg.norm(x[1] - x[0], axis=1).max()
    assert largest > 0.01
    np.testing.assert_allclose(moved, x[1] - x[0], atol=0.03 * largest)


@needs_compiler
def test_forces_and_exact_parameters_are_folded_in(model, tmp_path):
    """A robot half as stiff takes half the force for the same shape."""
    young = {"name": "E", "key": "material.young", "unit": "MPa", "low": 0.5, "high": 2.0, "reference": 1.0}
    meta = {**model.meta, "form": "force", "parameters": [{**young, "coordinate": "linear", "exact": True}]}
    from cfem.predict.kinds.spectral import SpectralPredictor

    soft = SpectralPredictor(meta, model.arrays)
    (tmp_path / "cfem_data.h").write_text("#include <stdint.h>\ntypedef double cfem_real;\n#define CFEM_NA 1\n")
    spec = replace_parameters(CSpec(), {"E": "0.5 MPa"})
    write_c_skin(tmp_path, soft, model.skin.arrays, spec)
    np.testing.assert_allclose(CompiledShape(tmp_path)([1.5]), model.shape([3.0]), atol=1e-10)


def replace_parameters(spec, parameters):
    return spec.model_copy(update={"parameters": parameters})
