"""Motion over time: mass, viscosity, an implicit scheme, natural frequencies; beside equilibrium, on its equations."""
