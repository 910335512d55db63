"""ONNX files that would run the code of others, read other files, or are no graph at all."""

import pytest

from cfem.core.errors import InputError
from cfem.predict.kinds.onnx import checked_graph

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


def test_a_tensor_as_large_as_allowed_passes(tmp_path):
    data = huge("ConstantOfShape", 2**24).SerializeToString()
    assert checked_graph(write(tmp_path, data)) == data


def nested(inner):
    """A graph in an `If`, in which `inner` is a constant."""
    branch = helper.make_graph(
        [helper.make_node("Constant", [], ["z"], value=inner)], "b", [],
        [helper.make_tensor_value_info("z", onnx.TensorProto.DOUBLE, [1])],
    )  # fmt: skip
    node = helper.make_node("If", ["c"], ["y"], then_branch=branch, else_branch=branch)
    made = helper.make_graph(
        [node], "g", [helper.make_tensor_value_info("c", onnx.TensorProto.BOOL, [])],
        [helper.make_tensor_value_info("y", onnx.TensorProto.DOUBLE, [1])],
    )  # fmt: skip
    return helper.make_model(made, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


def outside_tensor():
    tensor = helper.make_tensor("w", onnx.TensorProto.DOUBLE, [1], [2.0])
    tensor.data_location = onnx.TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="/etc/passwd")
    return tensor


def sparse():
    made = graph()
    values, places = outside_tensor(), helper.make_tensor("i", onnx.TensorProto.INT64, [1], [0])
    made.graph.sparse_initializer.append(helper.make_sparse_tensor(values, places, [1]))
    return made


def endless():
    """A loop of 2^62 rounds."""
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["on"])], "b",
        [helper.make_tensor_value_info("i", onnx.TensorProto.INT64, []),
         helper.make_tensor_value_info("go", onnx.TensorProto.BOOL, [])],
        [helper.make_tensor_value_info("on", onnx.TensorProto.BOOL, [])],
    )  # fmt: skip
    made = graph()
    made.graph.initializer.append(helper.make_tensor("trips", onnx.TensorProto.INT64, [], [2**62]))
    made.graph.initializer.append(helper.make_tensor("start", onnx.TensorProto.BOOL, [], [True]))
    made.graph.node.append(helper.make_node("Loop", ["trips", "start"], [], body=body))
    return made


def huge(op, size=10**12):
    """What an operator makes of a shape of `size` numbers."""
    made = graph()
    made.graph.initializer.append(helper.make_tensor("shape", onnx.TensorProto.INT64, [1], [size]))
    inputs = {"ConstantOfShape": ["shape"], "Expand": ["x", "shape"]}[op]
    made.graph.node.append(helper.make_node(op, inputs, ["big"]))
    return made


HOSTILE = {
    "operators of others": graph(domain="evil.ops").SerializeToString(),
    "numbers from elsewhere": graph(outside="../../../etc/passwd").SerializeToString(),
    "no operator": graph(op="NoSuch").SerializeToString(),
    "cut": graph().SerializeToString()[:-9],
    "numbers from elsewhere in a branch": nested(outside_tensor()).SerializeToString(),
    "numbers from elsewhere among sparse ones": sparse().SerializeToString(),
    "a loop without end": endless().SerializeToString(),
    "8 TB from a constant": huge("ConstantOfShape").SerializeToString(),
    "8 TB by expansion": huge("Expand").SerializeToString(),
    "a number more than allowed": huge("Expand", 2**24 + 1).SerializeToString(),
    "an operator that cfem does not write": graph(op="Mod").SerializeToString(),
    "empty": b"",
    "text": b"import os",
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE.keys())
def test_others_are_refused_in_one_line(tmp_path, data):
    with pytest.raises(InputError) as refused:
        checked_graph(write(tmp_path, data))
    assert "model.onnx" in str(refused.value) and len(str(refused.value).splitlines()) == 1
