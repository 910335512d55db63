"""How far an exported file is from the trained model, as a user runs it."""

import warnings
from pathlib import Path

import numpy as np

from cfem.predict.load import build


def largest_difference(name: str, path: Path, meta: dict, vectors: dict[str, np.ndarray]) -> float:
    """Largest difference of W and delta_free from those of the test vectors, relative to the largest entry of each.
    name: of the format."""
    answers, known = RUNNERS[name](path, meta, vectors["s"], vectors["p"]), (vectors["W"], vectors["delta_free"])
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in zip(answers, known, strict=True))


def _run_arrays(path: Path, meta: dict, s: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    with np.load(path, allow_pickle=False) as arrays:
        return build(meta, dict(arrays)).evaluate(s, p)


def _run_onnx(path: Path, meta: dict, s: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    from cfem.predict.kinds.onnx import OnnxPredictor

    return OnnxPredictor(meta, path).evaluate(s, p)


def _run_torchscript(path: Path, meta: dict, s: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, ...]:
    import torch

    inputs = (s, p) if meta["parameters"] else (s,)
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore", DeprecationWarning)
        return tuple(out.numpy() for out in torch.jit.load(path)(*map(torch.as_tensor, inputs)))


RUNNERS = {"arrays": _run_arrays, "onnx": _run_onnx, "torchscript": _run_torchscript}
