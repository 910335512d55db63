"""Bodies, constraints and an actuation to an equilibrium, its compliance W and free displacement delta_free."""
