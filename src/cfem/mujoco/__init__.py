"""Learned soft robots on the bodies of a MuJoCo model. Their whole surface touches its geoms and each other, with
friction, implicit in time.

    finger = SoftRobot.load("models/soft-finger/spectral", "pipelines/soft-finger/scene.yaml")
    world = World("scene.xml", {"left": finger, "right": finger})       # at the sites `left` and `right`
    world.step({"left": [3.0, 3.0], "right": [3.0, 3.0]})               # mm, as the scene's actuators

It needs `pip install 'cfem[mujoco]'`."""

from cfem.core.optional import demand

demand("mujoco", where="cfem.mujoco")

from cfem.mujoco.soft_robot import SoftRobot  # noqa: E402
from cfem.mujoco.world import World  # noqa: E402

__all__ = ["SoftRobot", "World"]
