"""Robots that differ in parameters p, learned or finite-element, as calibration and design see them."""
