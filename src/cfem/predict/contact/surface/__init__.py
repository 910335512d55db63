"""Surfaces of learned robots that may be touched, at patches or at nodes, and how they yield."""
