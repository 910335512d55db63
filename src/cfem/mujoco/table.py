"""A table with a cube of 50 g, and a carriage above it that two soft fingers hang from: a MuJoCo model."""

TABLE = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <visual><global offwidth="480" offheight="480"/></visual>
  <worldbody>
    <light pos="0.3 0.2 0.6" dir="-0.4 -0.3 -0.8"/>
    <camera name="side" pos="0.35 0.02 0.16" xyaxes="0 1 0 -0.2 0 1"/>
    <geom name="table" type="plane" size="0.3 0.3 0.01" rgba="0.8 0.8 0.8 1"/>
    <body name="carriage" pos="0 0 0.127">
      <joint name="height" type="slide" axis="0 0 1"/>
      <geom type="box" pos="0 0 0.01" size="0.02 0.07 0.008" mass="0.5" contype="0" conaffinity="0"/>
      <site name="left" pos="0 -0.04 0"/>
      <site name="right" pos="0 0.04 0" euler="0 0 180"/>
    </body>
    <body name="cube" pos="0 0 0.015">
      <freejoint/>
      <geom name="cube" type="box" size="0.015 0.015 0.015" mass="0.05" rgba="0.2 0.5 0.8 1"/>
    </body>
  </worldbody>
  <actuator><position name="height" joint="height" kp="2000" kv="60" ctrlrange="0 0.08"/></actuator>
</mujoco>
"""

QUICK_TABLE = TABLE.replace('timestep="0.002"', 'timestep="0.010"')  # for many episodes
