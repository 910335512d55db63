"""Sampling until a stated error: FE states are added where the model's error is largest."""
