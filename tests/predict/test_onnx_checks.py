"""ONNX files that would run the code of others, read other files, or are no graph at all."""

import pytest

from cfem.core.errors import InputError
from cfem.predict.onnx import checked_graph

onnx = pytest.importorskip("onnx")
helper = onnx.helper


def graph(op="Mul", domain="", outside=None):
    tensor = helper.make_tensor("w", onnx.TensorProto.DOUBLE, [1], [2.0])
    if outside:
        tensor.data_location = onnx.TensorProto.EXTERNAL
        tensor.external_data.add(key="location", value=outside)
    value = [helper.make_tensor_value_info(name, onnx.TensorProto.DOUBLE, [1]) for name in ("x", "y")]
    node = helper.make_node(op, ["x", "w"], ["y"], domain=domain)
    made = helper.make_graph([node], "g", value[:1], value[1:], [tensor])
    return helper.make_model(made, opset_imports=[helper.make_opsetid(domain, 17)], ir_version=8)


def write(tmp_path, data):
    path = tmp_path / "model.onnx"
    path.write_bytes(data)
    return path


def test_a_plain_graph_passes(tmp_path):
    data = graph().SerializeToString()
    assert checked_graph(write(tmp_path, data)) == data


HOSTILE = {
    "operators of others": graph(domain="evil.ops").SerializeToString(),
    "numbers from elsewhere": graph(outside="../../../etc/passwd").SerializeToString(),
    "no operator": graph(op="NoSuch").SerializeToString(),
    "cut": graph().SerializeToString()[:-9],
    "empty": b"",
    "text": b"import os",
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE.keys())
def test_others_are_refused_in_one_line(tmp_path, data):
    with pytest.raises(InputError) as refused:
        checked_graph(write(tmp_path, data))
    assert "model.onnx" in str(refused.value) and len(str(refused.value).splitlines()) == 1
