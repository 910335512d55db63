"""TorchScript: the traced module, for C++ and for Python without this package."""

import io
import warnings

import torch
from torch import nn


def torchscript_bytes(model: nn.Module, example: tuple[torch.Tensor, ...]) -> bytes:
    """Bytes of the traced module. example: inputs (2, ...); the batch axis stays free."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # torch calls its script format deprecated; it is what libtorch reads.
        warnings.simplefilter("ignore", DeprecationWarning)
        torch.jit.save(torch.jit.trace(model, example), buffer)
    return buffer.getvalue()
