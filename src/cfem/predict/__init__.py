"""Runs a trained model from its folder: one query, array code, no torch."""
