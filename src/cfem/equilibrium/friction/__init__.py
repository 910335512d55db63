"""Friction between cables and their guides."""
