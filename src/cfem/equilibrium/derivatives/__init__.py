"""Derivatives of an equilibrium and of its compliance, by forces and by parameters, from one factor."""
