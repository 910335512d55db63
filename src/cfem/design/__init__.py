"""Designs that are best at something, by learned robots, verified by finite elements."""
