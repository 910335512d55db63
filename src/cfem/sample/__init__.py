"""Which states to solve, in which order, from which start, by which processes: a plan to a dataset."""
