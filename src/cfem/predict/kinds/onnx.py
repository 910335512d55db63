"""Any exported model through ONNX Runtime, on one thread."""

import math
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import open_regular
from cfem.core.errors import InputError
from cfem.predict.protocol import Predictor

MAX_BYTES = 2**31 - 1  # protobuf's own limit
BATCH = 512  # states at once
MEMORY = 2**31  # bytes that graphs may take while they run
SECONDS = 20.0  # that a graph may take for a batch: a thousand times what the largest model does
LARGEST = 2**24  # numbers in one tensor of a graph: a constant, or what its shapes make for one state
# What `cfem export` writes. None of them loops, branches or holds a graph of its own.
OPERATORS = frozenset((
    "Abs", "Add", "Cast", "Concat", "Constant", "ConstantOfShape", "Cos", "Div", "Equal", "Exp", "Expand", "Flatten",
    "Gather", "Gemm", "Identity", "Less", "Log", "MatMul", "Mul", "Neg", "Pow", "Range", "Reciprocal", "ReduceSum",
    "Relu", "Reshape", "Shape", "Sigmoid", "Sin", "Slice", "Split", "Sqrt", "Squeeze", "Sub", "Tanh", "Transpose",
    "Unsqueeze", "Where",
))  # fmt: skip


def checked_graph(path: Path) -> bytes:
    """Bytes of an ONNX file. InputError unless it is a valid graph of the operators that cfem writes, its tensors are
    within the file and none is larger than a model's: operators of other domains would be code of others, and tensors
    outside would be read from wherever the file says."""
    import onnx

    where, do = str(path), "export it again with --force"
    with open_regular(path) as file:
        if os.fstat(file.fileno()).st_size > MAX_BYTES:
            raise InputError(f"is larger than {MAX_BYTES} bytes, which no ONNX file can be", where=where)
        data = file.read()
    try:
        model = onnx.load_model_from_string(data)
        reason = _foreign(model)
        if not reason:
            onnx.checker.check_model(model)
            reason = _oversized(onnx.shape_inference.infer_shapes(model, check_type=True, data_prop=True))
    except Exception as error:  # protobuf's and the checker's, which share no base class
        text = str(error).strip().splitlines()
        reason = f"is not a valid ONNX graph: {text[0][:300] if text else error!r}"
    if reason:
        raise InputError(reason, where=where, do=do)
    return data


def _foreign(model: Any) -> str:
    """Description of what a graph has that cfem would not have written, or empty."""
    graph = model.graph
    strange = sorted({node.op_type for node in graph.node} - OPERATORS)
    domains = {node.domain for node in graph.node} | {imported.domain for imported in model.opset_import}
    if strange or domains - {"", "ai.onnx"} or model.functions or model.training_info:
        return f"has operators that cfem does not write: {', '.join(strange[:3]) or 'of other domains'}"
    attributes = [attribute for node in graph.node for attribute in node.attribute]
    lists = any(attribute.graphs or attribute.tensors or attribute.sparse_tensors for attribute in attributes)
    if (
        lists
        or graph.sparse_initializer
        or any(attribute.HasField("g") or attribute.HasField("sparse_tensor") for attribute in attributes)
    ):
        return "has graphs or sparse tensors inside, which cfem does not write"
    tensors = [*graph.initializer, *(attribute.t for attribute in attributes)]
    if any(tensor.external_data or tensor.data_location != 0 for tensor in tensors):
        return "reads its numbers from other files"
    if any(math.prod(tensor.dims) > LARGEST for tensor in tensors):
        return f"has a tensor of more than {LARGEST} numbers"
    return ""


def _oversized(model: Any) -> str:
    """Which of the tensors whose size follows from the graph is too large, or empty."""
    for value in [*model.graph.value_info, *model.graph.output]:
        dims = [axis.dim_value for axis in value.type.tensor_type.shape.dim if axis.HasField("dim_value")]
        if math.prod(dims) > LARGEST or any(size < 0 for size in dims):
            return f"makes a tensor of {math.prod(dims)} numbers, '{value.name[:50]}'"
    return ""


@cache
def _limit_memory() -> None:
    """Bounds the memory of all graphs of this process together: sizes that follow from the input are known when it
    runs, no sooner."""
    import onnxruntime as ort

    where = ort.OrtMemoryInfo("Cpu", ort.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, ort.OrtMemType.DEFAULT)
    ort.create_and_register_allocator(where, ort.OrtArenaCfg({"max_mem": MEMORY}))


class _Watch:
    """Ends runs of a graph that take longer than SECONDS, after the operator at which they are: one thread for all of
    the process, started by the first run; a run costs two assignments."""

    def __init__(self):
        self._running: dict[int, tuple[float, Any]] = {}
        self._thread: threading.Thread | None = None

    @contextmanager
    def over(self, options: Any) -> Iterator[None]:
        """The run whose onnxruntime.RunOptions these are."""
        if self._thread is None or not self._thread.is_alive():  # nor is it in a forked process
            self._thread = threading.Thread(target=self._watch, name="cfem-onnx-watch", daemon=True)
            self._thread.start()
        self._running[id(options)] = time.monotonic() + SECONDS, options
        try:
            yield
        finally:
            del self._running[id(options)]

    def _watch(self) -> None:
        while True:
            time.sleep(min(1.0, SECONDS / 4))
            for deadline, options in list(self._running.values()):
                if time.monotonic() > deadline:
                    options.terminate = True


_WATCH = _Watch()


class OnnxPredictor(Predictor):
    """Inputs and outputs of the graph: delta_a or lambda_a (B, n_a) by the form, p (B, n_p) where it has parameters ->
    W (B, n, n), delta_free (B, n), float64."""

    def __init__(self, meta: dict, path: Path):
        """Checks the graph of the file, and loads it into a session of one thread."""
        import onnxruntime as ort

        super().__init__(meta)
        data = checked_graph(path)
        _limit_memory()
        options = ort.SessionOptions()
        options.add_session_config_entry("session.use_env_allocators", "1")
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            # Nothing is computed before the watch can end it; what cfem writes has its constants folded.
            without = {"disabled_optimizers": ["ConstantFolding"]}
            self._session = ort.InferenceSession(data, options, providers=["CPUExecutionProvider"], **without)
        except Exception as error:  # ONNX Runtime's own exceptions share no base class of their own
            raise InputError(
                f"ONNX Runtime cannot load it: {error}", where=str(path), do="export it again with --force"
            ) from error
        self._options = ort.RunOptions()
        self._inputs = tuple(tensor.name for tensor in self._session.get_inputs())
        outputs = [tensor.name for tensor in self._session.get_outputs()]
        if len(self._inputs) != 1 + bool(self.parameters) or not {"W", "delta_free"} <= set(outputs):
            what = f"has inputs {', '.join(self._inputs)} and outputs {', '.join(outputs)}, which are not the model's"
            raise InputError(what, where=str(path), do="export it again with --force")

    def evaluate(self, s: np.ndarray, p: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """W (..., n, n) and delta_free (..., n) at inputs s (..., n_a), in batches."""
        s = np.asarray(s, float)
        inputs = {self._inputs[0]: s.reshape(-1, s.shape[-1])}
        if self.parameters:
            p = np.broadcast_to(self._p(p), (*s.shape[:-1], len(self.parameters)))
            inputs[self._inputs[1]] = np.ascontiguousarray(p.reshape(-1, p.shape[-1]))
        m, n = len(inputs[self._inputs[0]]), self.rows.n
        W, delta_free = np.empty((m, n, n)), np.empty((m, n))
        for first in range(0, m, BATCH):
            some = slice(first, first + BATCH)
            W[some], delta_free[some] = self._run({name: values[some] for name, values in inputs.items()})
        return W.reshape(*s.shape[:-1], n, n), delta_free.reshape(*s.shape[:-1], n)

    def _run(self, inputs: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """One run of the graph. InputError where it takes too long, fails, or returns other shapes."""
        m, n, do = len(inputs[self._inputs[0]]), self.rows.n, "export it again with --force"
        try:
            with _WATCH.over(self._options):
                W, delta_free = self._session.run(["W", "delta_free"], inputs, self._options)
        except Exception as error:  # see above
            if self._options.terminate:
                raise InputError(f"takes more than {SECONDS:g} s for {m} states, which no model does", do=do) from None
            reason = next(iter(str(error).splitlines()), repr(error))
            raise InputError(f"ONNX Runtime cannot run it: {reason[:300]}", do=do) from error
        if W.shape != (m, n, n) or delta_free.shape != (m, n) or W.dtype != float or delta_free.dtype != float:
            what = f"gives W {W.shape} and delta_free {delta_free.shape} for {m} states of {n} rows"
            raise InputError(what, do=do)
        return W, delta_free
