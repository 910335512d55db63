"""The laws of Signorini and Coulomb at points of one linearisation: the problem, its solutions, and their check."""
