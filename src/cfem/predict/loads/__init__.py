"""Learned robots under loads that their samples did not carry."""
