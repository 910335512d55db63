"""`cfem predict-cases`: other load cases of a robot that `cfem calibrate-cases` has calibrated."""
