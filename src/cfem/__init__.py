"""Condensed finite-element models of soft robots: sampled, learned, exported, controlled."""

__version__ = "0.1.0"
