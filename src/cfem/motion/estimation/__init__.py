"""States and unknown forces of a moving robot, from markers."""
