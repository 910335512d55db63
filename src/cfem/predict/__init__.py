"""Runs a trained model from its folder: one query, array code, no torch."""

from pathlib import Path

from cfem.core.cache import place_compiled_code

place_compiled_code(Path(__file__).parent)
