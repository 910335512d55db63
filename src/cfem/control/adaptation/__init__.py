"""Parameters of the robot that are tracked while it works, and the controller that uses them."""
