"""Search for the actuation that brings the effectors to one goal: inverse step, QP, restarts, optimality."""
