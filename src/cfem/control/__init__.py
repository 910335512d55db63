"""Inverse control: from a goal of the effectors to what the actuators must do, by condensed models of any
origin."""
