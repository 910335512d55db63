"""What forces on their surfaces do to learned robots at held actuators."""
