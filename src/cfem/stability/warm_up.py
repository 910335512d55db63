"""Compiles all kernels once for an installation: `python -m cfem.stability.warm_up`. scripts/setup.sh and `cfem demo`
do so, so that no later command spends its first minute on it. What is heavy is imported where it is used, so that the
display is there before it."""

import sys
from pathlib import Path

from cfem.core.progress import doing, labelled, progress, shown

ELEMENTS = ("tet10p0", "hex8")


def is_warm() -> bool:
    """Whether machine code of the kernels is on disk."""
    from cfem.mechanics.solid_kernels import scatter_stiffness

    return any(Path(scatter_stiffness.stats.cache_path).glob("*scatter_stiffness*.nbi"))


def warm_up() -> None:
    """Solves a small bar of every material law, in which every kernel of solids takes part."""
    with labelled("set-up"):
        doing("importing the solver")
        from cfem.mechanics.material import LAWS

        cases = [(element, law) for element in ELEMENTS for law in LAWS]
        with progress("compiling kernels", len(cases)) as advance:
            for element, law in cases:
                _solve(element, law)
                advance(1)


def _solve(element: str, law: str) -> None:
    import numpy as np

    from cfem.equilibrium.actuation import displacement
    from cfem.equilibrium.problem import Problem
    from cfem.equilibrium.solve import solve
    from cfem.stability.bodies import bar, bar_body

    robot = bar(bar_body(element, law))
    found = solve(Problem(robot), displacement(np.full(robot.rows.n_a, 0.5)), third_order=element != "hex8")
    if not found.converged:
        raise AssertionError(f"{element}, {law}: {found.status.value}")


if __name__ == "__main__":
    with shown("set-up", quiet="--quiet" in sys.argv):
        warm_up()
