"""A graph that passes every check and wants more memory than any model is ended."""

import json
import subprocess
import sys

import pytest
from export.embedded import spectral

onnx = pytest.importorskip("onnx")
helper, DOUBLE = onnx.helper, onnx.TensorProto.DOUBLE
SIDE = 1000  # 8 MB
# In a process of its own: the bound is of a process, once.
ASK = """
import json, sys
from pathlib import Path
from cfem.core.errors import InputError
from cfem.predict.kinds import onnx
onnx.MEMORY = 1_000_000
model = onnx.OnnxPredictor(json.loads(sys.argv[2]), Path(sys.argv[1]))
try:
    model.evaluate([[1.0, 2.0]])
except InputError as error:
    print(error)
"""


def large():
    sides = helper.make_tensor("sides", onnx.TensorProto.INT64, [2], [SIDE, SIDE])
    # of the input, so that nothing can be known before it runs
    nodes = [
        helper.make_node("ReduceSum", ["delta_a"], ["sum"], keepdims=0),
        helper.make_node("Expand", ["sum", "sides"], ["square"]),
        helper.make_node("ReduceSum", ["square"], ["W"], keepdims=1),
        helper.make_node("Neg", ["W"], ["delta_free"]),
    ]
    inputs = [helper.make_tensor_value_info("delta_a", DOUBLE, ["batch", 2])]
    outputs = [helper.make_tensor_value_info(name, DOUBLE, [1, 1]) for name in ("W", "delta_free")]
    graph = helper.make_graph(nodes, "g", inputs, outputs, [sides])
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def test_a_graph_that_takes_more_memory_is_ended_in_one_sentence(tmp_path):
    (tmp_path / "model.onnx").write_bytes(large().SerializeToString())
    meta = json.dumps({"errors": {}, "dataset": {}} | spectral()[0])
    words = [sys.executable, "-c", ASK, tmp_path / "model.onnx", meta]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert "ONNX Runtime cannot run it" in said and "Arena" in said
