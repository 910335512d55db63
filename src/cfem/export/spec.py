"""export.yaml: which trained model, in which formats."""

from pathlib import Path
from typing import Literal

from cfem.core.spec import Spec

Format = Literal["arrays", "onnx", "torchscript"]


class ExportSpec(Spec):
    """model: folder of `cfem train`."""

    model: Path
    out: Path
    formats: tuple[Format, ...] = ("arrays", "onnx", "torchscript")
