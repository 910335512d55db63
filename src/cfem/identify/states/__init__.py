"""Recorded markers to the robot's state and the forces on it: `cfem estimate`."""
