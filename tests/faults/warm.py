"""Imported by the process that the killed ones are forked from: a dataset has been made, so that all is imported."""

import tempfile
from pathlib import Path

import onnx
import onnxruntime
import onnxscript
import torch._dynamo
from faults.sampling import make

import cfem.control.stage
import cfem.export.compiled.controller
import cfem.export.onnx
import cfem.export.stage
import cfem.export.torchscript
import cfem.surrogate.networks.mlp
import cfem.surrogate.series.spectral

__all__ = ["cfem", "onnx", "onnxruntime", "onnxscript", "torch"]

with tempfile.TemporaryDirectory() as folder:
    make(Path(folder) / "out")
