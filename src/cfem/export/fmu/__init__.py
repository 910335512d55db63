"""Units of co-simulation, FMI 3.0, around the C99 of `cfem.export.firmware`."""
