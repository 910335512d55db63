from cfem.equilibrium.robot import Robot

__all__ = ["Robot"]
