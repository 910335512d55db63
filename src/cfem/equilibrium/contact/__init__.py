"""Equilibria in contact: obstacles, other robots, objects, ground."""
