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


def test_each_state_has_its_parameters_and_batches_come_back_in_their_shape(monkeypatch):
    """One p for all states, or one for each; more states than a batch has."""
    monkeypatch.setattr("cfem.predict.kinds.onnx.BATCH", 4)
    asked = []

    def run(names, inputs, options):
        assert names == ["W", "delta_free"]
        s, p = inputs["delta_a"], inputs["p"]
        assert p.flags.c_contiguous and len(s) == len(p) <= 4
        asked.append(len(s))
        return [np.einsum("bi,bj->bij", np.repeat(s, 2, axis=1), np.tile(p, 2)), np.tile(s + p, 2)]

    import onnxruntime as ort

    model = OnnxPredictor.__new__(OnnxPredictor)
    model.rows, model._inputs, model._options = SimpleNamespace(n=4), ("delta_a", "p"), ort.RunOptions()
    model.parameters, model._session, model._p = ("a", "b"), SimpleNamespace(run=run), np.asarray
    s, p = np.arange(12.0).reshape(3, 2, 2), np.array([0.5, 2.0])
    for each in (p, np.arange(12.0).reshape(3, 2, 2) + 1):
        asked.clear()
        W, delta_free = model.evaluate(s, each)
        assert asked == [4, 2]
        every = np.broadcast_to(each, s.shape)
        np.testing.assert_array_equal(delta_free, np.concatenate([s + every] * 2, axis=-1))
        np.testing.assert_array_equal(W[..., 0, 1], s[..., 0] * every[..., 1])
        assert W.shape == (3, 2, 4, 4)
    with pytest.raises(InputError, match="ONNX Runtime cannot run it: no room"):
        model._session = SimpleNamespace(run=lambda *_: (_ for _ in ()).throw(RuntimeError("no room\nfor it")))
        model._run({"delta_a": np.zeros((2, 2))})
