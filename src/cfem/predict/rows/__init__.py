"""Modules in a row, each known by a learned model of its own."""
