"""The ways of cables through a body of which only the shape is known."""
