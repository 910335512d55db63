"""A robot that moves itself over the ground by friction: a gait is found on a learned model, finite elements walk."""
