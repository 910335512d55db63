"""A network on the condensed model at rest, of one robot: what tells the robots apart is a constant of its C code."""

import numpy as np
import pytest
from export.embedded import export, needs_compiler, network, spectral, states
from export.test_c_model import TOLERANCE, largest_difference
from surrogate.synthetic import dataset

from cfem.export.compiled.controller import CompiledController
from cfem.predict.kinds.mlp import AT_REST, rest_entries
from cfem.predict.load import build
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.observations import inputs

pytestmark = needs_compiler


def pair() -> tuple[dict, dict]:
    """Random weights, the first layer widened to the inputs at rest."""
    training = dataset(60, 1, parameters=True)
    (rest, series), (_, arrays) = spectral("displacement", 2, True), network("silu")
    beside = rest_entries(build(rest, series), inputs(training, "displacement")[1])
    more = 0.3 * np.random.default_rng(4).normal(size=(len(arrays["bias_0"]), beside.shape[1]))
    scale = np.where(beside.std(axis=0) > 1e-3, beside.std(axis=0), np.inf)
    arrays = arrays | {
        "in_mean": np.concatenate([arrays["in_mean"], beside.mean(axis=0)]),
        "in_scale": np.concatenate([arrays["in_scale"], scale]),
        "weight_0": np.hstack([arrays["weight_0"], more.astype(np.float32)]),
        **{AT_REST + name: values for name, values in series.items()},
    }
    return model_card("mlp", training, activation="silu", at_rest=rest), arrays


@pytest.mark.parametrize(("scalar", "weights"), [("double", "scalar"), ("float", "scalar"), ("float", "int16")])
def test_one_robot_of_a_pair(tmp_path, scalar, weights):
    meta, arrays = pair()
    chosen = {"poisson": 0.46, "young": "2 MPa"}
    export(tmp_path, (meta, arrays), scalar=scalar, hidden_weights=weights, parameters=chosen)
    wide = build(meta, {name: a.astype(float) if a.dtype.kind == "f" else a for name, a in arrays.items()})
    s, controller = states("displacement", 2, 40), CompiledController(tmp_path)
    difference = largest_difference(controller, wide, s, np.array([0.46, 2.0]), full=False)
    assert difference <= (1e-3 if weights == "int16" else TOLERANCE[scalar])
    assert largest_difference(controller, wide, s, np.array([0.31, 2.0]), full=False) > 1e-3
