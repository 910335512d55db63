"""What a graph gives is checked in shape and type before anybody counts on it."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.predict.onnx import OnnxPredictor

ROWS = Rows(("tip.x", "tip.y", "tip.z"), ("cable",))


def predictor(run):
    """One whose session is a function of the inputs."""
    made = object.__new__(OnnxPredictor)
    made.rows, made._inputs = ROWS, ("s",)
    made._options = SimpleNamespace(terminate=False)
    made._session = SimpleNamespace(run=lambda names, inputs, options: run(inputs["s"]))
    return made


def sound(s):
    return np.broadcast_to(np.eye(4), (len(s), 4, 4)).copy(), np.zeros((len(s), 4))


def test_what_has_the_shapes_of_the_rows_is_taken():
    W, delta_free = predictor(sound)._run({"s": np.zeros((3, 1))})
    assert W.shape == (3, 4, 4) and delta_free.shape == (3, 4)


WRONG = {
    "states of W": lambda W, d: (W[:-1], d),
    "rows of W": lambda W, d: (W[:, :3], d),
    "columns of W": lambda W, d: (W[:, :, :3], d),
    "states of delta_free": lambda W, d: (W, d[:-1]),
    "rows of delta_free": lambda W, d: (W, d[:, :3]),
    "single precision of W": lambda W, d: (W.astype(np.float32), d),
    "single precision of delta_free": lambda W, d: (W, d.astype(np.float32)),
}


@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG.keys())
def test_other_shapes_and_types_are_refused(change):
    with pytest.raises(InputError, match=r"gives W .* for 3 states of 4 rows \(export it again"):
        predictor(lambda s: change(*sound(s)))._run({"s": np.zeros((3, 1))})


def test_an_error_of_the_runtime_is_one_line_and_a_run_that_was_ended_says_so():
    def fail(s):
        raise RuntimeError("node 'MatMul' failed" + 400 * "x" + "\nsecond line")

    made = predictor(fail)
    with pytest.raises(InputError, match="ONNX Runtime cannot run it: node 'MatMul' failed") as refused:
        made._run({"s": np.zeros((1, 1))})
    assert "second line" not in str(refused.value) and len(str(refused.value)) < 400
    made._options.terminate = True
    with pytest.raises(InputError, match=r"takes more than .* s for 1 states"):
        made._run({"s": np.zeros((1, 1))})
