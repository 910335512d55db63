"""What the robot is: spec, CAD, mesh, bodies and constraints."""
