"""A new scene from a shape in a file and a few answers, the others guessed from the shape."""
