"""Damping and viscosity from a free oscillation that cameras recorded."""
