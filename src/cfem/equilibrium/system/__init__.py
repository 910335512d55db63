"""What is solved: the robot, its equations at one place, what drives it, and the answer."""
