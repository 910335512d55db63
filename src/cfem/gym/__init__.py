"""Learned robots as Gymnasium environments: `import cfem.gym` then `cfem.gym.register()` makes known
cfem/Reach-v0, cfem/Follow-v0, cfem/Press-v0, cfem/Carry-v0, and of models that move cfem/MovingReach-v0 and
cfem/MovingFollow-v0; with `cfem[mujoco]` also cfem/Lift-v0 (`cfem.mujoco.lift`).

    env = gymnasium.make("cfem/Reach-v0", model="models/soft-finger/spectral")
    many = gymnasium.make_vec("cfem/Reach-v0", 1024, vectorization_mode="vector_entry_point", model=...)

It needs `pip install 'cfem[gym]'`."""

from pathlib import Path

from cfem.core.cache import place_compiled_code

place_compiled_code(Path(__file__).parent)

TASKS = ("reach", "follow", "press", "carry", "moving-reach", "moving-follow")
NAMES = {f"cfem/{task.title().replace('-', '')}-v0": task for task in TASKS}

LIFT = "cfem/Lift-v0"  # on a world of MuJoCo, not on a batch of robots


def register() -> None:
    """Makes the names known to Gymnasium. MissingPackageError without it."""
    from cfem.core.optional import demand

    demand("gymnasium", "numba", where="cfem.gym")
    import gymnasium

    for name, task in NAMES.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="cfem.gym.environments:RobotEnv",
                vector_entry_point="cfem.gym.environments:RobotVectorEnv",
                kwargs={"task": task},
            )
    if LIFT not in gymnasium.registry:
        gymnasium.register(LIFT, entry_point="cfem.mujoco.lift:LiftEnv")
