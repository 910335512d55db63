"""Robots that touch, press or avoid obstacles: models with contact, the FE robot that meets the same, what is asked."""
