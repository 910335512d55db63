"""From measurements to the parameters of the robot that was measured."""
