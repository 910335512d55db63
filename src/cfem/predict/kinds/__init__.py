"""Kinds of learned model: Chebyshev series, networks, ONNX."""
