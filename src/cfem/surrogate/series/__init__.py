"""Fits of the energy model as Chebyshev series."""
