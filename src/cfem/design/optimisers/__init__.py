"""Searches for the best design."""
