"""Solved states of a robot as Parquet: one row a state, every column with its unit, readable without cfem."""
