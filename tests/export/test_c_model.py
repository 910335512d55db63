"""The compiled model equals the Python model, block by block, for every kind, form, scalar and parameter."""

import numpy as np
import pytest
from export.embedded import export, needs_compiler, network, serial, spectral, states
from support.fast_cases import fast_are

from cfem.core.errors import InputError, SpecError
from cfem.export.compiled.controller import CompiledController
from cfem.predict.load import build
from cfem.predict.series.energy import layout

pytestmark = needs_compiler
TOLERANCE = {"double": 1e-12, "float": 1e-5}
CASES = {
    "two cables": (("displacement", 2), {}),
    "one cable": (("displacement", 1), {}),
    "three cables": (("displacement", 3), {}),
    "forces": (("force", 2), {}),
    "robots": (("displacement", 2, True), {"parameters": {"poisson": 0.44, "young": "2 MPa"}}),
    "robots by forces": (("force", 2, True), {"parameters": {"poisson": 0.44, "young": "2 MPa"}}),
}


def largest_difference(controller: CompiledController, model, s: np.ndarray, p=None, full: bool = True) -> float:
    """Of any block at any state, relative to the largest entry of the block in all states; delta_free is a part of
    delta and takes its size."""
    e, a = model.rows.e, model.rows.a
    found, expected = [controller.model(one) for one in s], [model.at(one, p) for one in s]
    assert not any(one["status"] for one in found)
    W, free = np.array([one.W for one in expected]), np.array([one.delta_free for one in expected])
    lam, delta = np.array([one.lam for one in expected]), np.array([one.delta for one in expected])
    blocks = {"W_aa": W[:, a, a], "W_ea": W[:, e, a], "lambda_a": lam, "delta_a": delta[:, a]}
    blocks |= {"free_a": free[:, a], "free_e": free[:, e]} | ({"W_ee": W[:, e, e]} if full else {})
    sizes = {name: np.abs(block).max() for name, block in blocks.items()} | {"free_a": np.abs(delta[:, a]).max()}
    return max(
        np.abs(np.reshape([one[name] for one in found], block.shape) - block).max() / sizes[name]
        for name, block in blocks.items()
    )


@pytest.mark.parametrize("scalar", fast_are({"double"}, ["double", "float"]))
@pytest.mark.parametrize("case", fast_are({"two cables", "forces", "robots"}, CASES), ids=str)
def test_the_energy_model(tmp_path, case, scalar):
    arguments, options = CASES[case]
    meta, arrays = spectral(*arguments)
    model = build(meta, arrays)
    values = options.get("parameters", {})
    p = np.array([{"poisson": 0.44, "young": 2.0}[one.name] for one in model.parameters]) if values else None
    export(tmp_path, (meta, arrays), scalar=scalar, full=True, **options)
    s = states(arguments[0], arguments[1], 40, parameters=bool(values))
    if arguments[0] == "force" and values:
        s = s / model.softer(p)
    assert largest_difference(CompiledController(tmp_path), model, s, p) <= TOLERANCE[scalar]


@pytest.mark.parametrize("scalar", fast_are({"double"}, ["double", "float"]))
@pytest.mark.parametrize("modules", fast_are({3}, [1, 2, 3]))
def test_modules_in_a_row(tmp_path, modules, scalar):
    """And where a module does not turn, where the closed form of its Jacobian is 0 / 0."""
    meta, arrays = serial(modules)
    export(tmp_path, (meta, arrays), scalar=scalar)
    model, controller = build(meta, arrays), CompiledController(tmp_path)
    s = states("displacement", 3 * modules, 40)
    turns = np.array([model.models[0].at(one[:3]).delta_e[3:] for one in s])
    assert 0.5 < np.linalg.norm(turns, axis=1).max() < np.pi
    assert largest_difference(controller, model, s, full=False) <= TOLERANCE[scalar]
    still = {**arrays, "0.series": arrays["0.series"].copy()}
    still["0.series"][layout(3, 6)["effector"]][3:] *= 1e-5
    still["0.series"][layout(3, 6)["effector_gradient"]][9:] *= 1e-5
    export(tmp_path / "still", (meta, still), scalar=scalar)
    difference = largest_difference(CompiledController(tmp_path / "still"), build(meta, still), s, full=False)
    assert difference <= TOLERANCE[scalar]


def test_what_modules_in_a_row_have_no_c_code_for(tmp_path):
    meta, arrays = serial()
    with pytest.raises(SpecError, match=r"c\.full"):
        export(tmp_path, (meta, arrays), full=True)
    with pytest.raises(InputError, match="unheard"):
        export(tmp_path, (meta | {"modules": [meta["modules"][0] | {"kind": "unheard"}]}, arrays))


def test_the_energy_is_that_of_the_series(tmp_path):
    meta, arrays = spectral()
    export(tmp_path, (meta, arrays), full=True)
    s = states("displacement", 2, 5)
    expected = build(meta, arrays).parts(s, s[:, :0])["energy"][:, 0]
    controller = CompiledController(tmp_path)
    assert np.allclose([controller.model(one)["energy"][0] for one in s], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("activation", "scalar"), [("relu", "double"), ("relu", "float"), ("tanh", "float"), ("silu", "double")]
)
def test_the_network(tmp_path, activation, scalar):
    meta, arrays = network(activation)
    export(tmp_path, (meta, arrays), scalar=scalar, full=True)
    wide = build(meta, {name: array.astype(float) for name, array in arrays.items()})
    difference = largest_difference(CompiledController(tmp_path), wide, states("displacement", 2, 40))
    assert difference <= TOLERANCE[scalar]


def test_sixteen_bit_weights_cost_half_and_little_accuracy(tmp_path):
    model = network(width=64)
    reports = {
        kind: export(tmp_path / kind, model, scalar="float", hidden_weights=kind) for kind in ("scalar", "int16")
    }
    assert reports["int16"]["coefficient_bytes"] < 0.75 * reports["scalar"]["coefficient_bytes"]
    s = states("displacement", 2, 40)
    wide = build(model[0], {name: array.astype(float) for name, array in model[1].items()})
    assert 1e-7 < largest_difference(CompiledController(tmp_path / "int16"), wide, s, full=False) < 1e-3


def test_control_carries_no_block_that_it_does_not_use(tmp_path):
    full, lean = (export(tmp_path / str(i), spectral(), full=bool(i)) for i in (1, 0))
    assert lean["coefficient_bytes"] < full["coefficient_bytes"]
    assert "compliance" not in (tmp_path / "0" / "cfem_data.c").read_text()


def test_what_has_no_c_code_is_refused(tmp_path):
    meta, arrays = spectral()
    with pytest.raises(InputError, match="unheard"):
        export(tmp_path, ({**meta, "kind": "unheard"}, arrays))
    with pytest.raises(InputError, match="contact"):
        export(tmp_path, ({**meta, "n_c": 3}, arrays))
    with pytest.raises(SpecError, match="stiffness"):
        export(tmp_path, (meta, arrays), parameters={"stiffness": 1.0})
    with pytest.raises(SpecError, match=r"c\.controller\.weights"):
        export(tmp_path, (meta, arrays), controller={"weights": [1.0]})
