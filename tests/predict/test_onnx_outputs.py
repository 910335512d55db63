"""What a graph gives is taken only in the shapes and the precision that the model's rows ask for."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.predict.kinds.onnx import OnnxPredictor

pytest.importorskip("onnxruntime")

RIGHT = np.zeros((2, 5, 5)), np.zeros((2, 5))


def given(W, delta_free):
    """A predictor of five rows whose graph gives these."""
    import onnxruntime as ort

    model = OnnxPredictor.__new__(OnnxPredictor)
    model.rows, model._inputs = SimpleNamespace(n=5), ["delta_a"]
    model._options = ort.RunOptions()
    model._session = SimpleNamespace(run=lambda *_: [W, delta_free])
    return model._run({"delta_a": np.zeros((2, 2))})


def test_the_right_outputs_pass():
    W, delta_free = given(*RIGHT)
    assert W is RIGHT[0] and delta_free is RIGHT[1]


@pytest.mark.parametrize(
    "outputs",
    [
        (np.zeros((2, 5, 4)), RIGHT[1]),
        (np.zeros((1, 5, 5)), RIGHT[1]),
        (RIGHT[0], np.zeros((2, 4))),
        (RIGHT[0].astype(np.float32), RIGHT[1]),
        (RIGHT[0], RIGHT[1].astype(np.float32)),
    ],
)
def test_others_are_refused(outputs):
    with pytest.raises(InputError, match=r"gives W \(.*\) and delta_free \(.*\) for 2 states of 5 rows"):
        given(*outputs)
