"""All stages of a robot, in order: what needs what, what is stale and why."""
