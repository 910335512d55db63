"""A graph that passes every check and hardly ever ends is ended."""

import pytest
from export.embedded import spectral

from cfem.core.errors import InputError
from cfem.predict.kinds import onnx as module
from cfem.predict.kinds.onnx import OnnxPredictor

onnx = pytest.importorskip("onnx")
helper, DOUBLE = onnx.helper, onnx.TensorProto.DOUBLE
SIDE, TIMES = 1000, 2000  # a tenth of a second each


def endless():
    sides = helper.make_tensor("sides", onnx.TensorProto.INT64, [2], [SIDE, SIDE])
    zero = helper.make_tensor("zero", DOUBLE, [1], [0.0])
    # of the input, so that nothing can be known before it runs
    nodes = [
        helper.make_node("ReduceSum", ["delta_a"], ["sum"], keepdims=0),
        helper.make_node("Expand", ["sum", "sides"], ["m0"]),
        *(helper.make_node("MatMul", [f"m{i}", "m0"], [f"m{i + 1}"]) for i in range(TIMES)),
        helper.make_node("ReduceSum", [f"m{TIMES}"], ["W"], keepdims=1),
        helper.make_node("Mul", ["W", "zero"], ["delta_free"]),
    ]
    inputs = [helper.make_tensor_value_info("delta_a", DOUBLE, ["batch", 2])]
    outputs = [helper.make_tensor_value_info(name, DOUBLE, [1, 1]) for name in ("W", "delta_free")]
    graph = helper.make_graph(nodes, "g", inputs, outputs, [sides, zero])
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def test_a_graph_that_takes_too_long_is_ended_in_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "SECONDS", 0.2)
    (tmp_path / "model.onnx").write_bytes(endless().SerializeToString())
    model = OnnxPredictor({"errors": {}, "dataset": {}} | spectral()[0], tmp_path / "model.onnx")
    with pytest.raises(InputError, match=r"takes more than 0\.2 s for 1 states"):
        model.evaluate([[1.0, 2.0]])
