"""Models of (W, delta_free) over the actuator displacements, fitted to a dataset of FE states."""
