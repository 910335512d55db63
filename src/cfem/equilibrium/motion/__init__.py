"""Mass, viscosity, inner motions and natural frequencies at an equilibrium."""
