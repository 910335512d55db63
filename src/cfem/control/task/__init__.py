"""What a run is asked to do, and under what: goals, obstacles, loads, a design."""
