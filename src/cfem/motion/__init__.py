"""Motion of condensed models: learned mass and viscosity, natural frequencies, steps in time. NumPy and SciPy only."""
