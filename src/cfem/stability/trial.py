"""An equilibrium that was tried."""

from collections.abc import Callable
from dataclasses import dataclass

from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solution import Equilibrium, State
from cfem.equilibrium.solve import solve
from cfem.stability.evidence import Evidence


@dataclass(frozen=True)
class Trial:
    """slack: whether unilateral actuators could go slack."""

    robot: Robot
    actuation: Actuation
    slack: bool
    answer: Equilibrium

    def evidence(self) -> Evidence:
        from cfem.stability.examine import examine

        return examine(self)


def attempt(
    make: Callable[[], Robot],
    actuation: Actuation | Callable[[Robot], Actuation],
    slack: bool = True,
    start: Callable[[Robot], State] | None = None,
) -> Callable[[], Trial]:
    """Builds the robot and solves, from rest unless `start` says otherwise."""

    def work() -> Trial:
        made = make()
        wanted = actuation(made) if callable(actuation) else actuation
        answer = solve(Problem(made), wanted, start=start(made) if start else None, slack=slack)
        return Trial(made, wanted.padded(len(answer.delta)), slack, answer)

    return work
