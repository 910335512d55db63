"""Mesh a scene and solve one state: run in the folder that holds `pipelines`."""

import cfem

robot = cfem.load_robot("pipelines/bar/scene.yaml", overrides=["mesh.size=10 mm"])
print(f"{len(robot.X)} nodes; actuators {robot.rows.actuators}; reach {robot.reach} mm")

found = cfem.solve(robot, displacement=[5.0])
print(f"the tip moves by {found.delta_e} mm; the cable pulls with {found.lambda_a} N")
print(f"compliance W of rows {robot.rows.names}:\n{found.condensed.W}")
