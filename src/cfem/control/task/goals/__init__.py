"""Goals that the effectors follow: points, arcs, curves, laps, and their specs."""
