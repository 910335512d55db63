"""Contact of learned robots with obstacles, objects, other robots and themselves, with friction."""
