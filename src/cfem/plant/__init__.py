"""What control acts on: a plant takes a command of the actuators and says what became of it."""
