"""The reach of each actuator: asked for, with the stroke that solving finds as what is suggested."""

from collections.abc import Callable, Collection, Sequence

from cfem.core.console.progress import progress
from cfem.equilibrium.system.robot import Robot
from cfem.init.drive import Drive
from cfem.init.question import Answer, Ask, Question, positive
from cfem.init.stroke import Stroke, with_contact
from cfem.init.written import short

_SOLVES = 8  # of an actuator, about


def reaches(
    robot: Robot, driven: Drive, pushes: int, stated: Collection[str], ask: Ask, cells: str
) -> tuple[tuple[Answer, ...], Answer | None]:
    """Reach of each actuator until a limit, cables and pushes in mm, chambers in mm^3, by solving on the coarse
    mesh; and whether walls push each other (`with_contact`). stated: the flags to which `ask` has an answer already;
    cells: of that mesh, in words."""
    kinds = (
        ("reach", "By how much may each cable be shortened?", "mm", "N", len(driven.cables)),
        ("growth", "By how much may each chamber grow?", "mm^3", "kPa", len(driven.chambers)),
        ("travel", "By how far may each push move its point?", "mm", "N", pushes),
    )
    kinds = tuple(kind for kind in kinds if kind[-1])
    strokes: list[Stroke] = []
    contact = None
    if "self-contact" in stated or any(flag not in stated for flag, *_ in kinds):
        with progress(
            "finding how far the actuators go, on the coarse mesh", _SOLVES * robot.rows.n_a, estimate=False
        ) as advance:
            strokes, contact = with_contact(robot, ask, "self-contact" in stated, advance)
    answers: list[Answer] = []
    for flag, text, unit, of_force, count in kinds:
        mine = slice(len(answers), len(answers) + count)
        default, whys = _suggested(strokes[mine], count, unit, f"{of_force} on {cells}")
        question = Question(flag, text, default, _by_name(robot.rows.actuators[mine], whys), _amounts(unit, count))
        answer = ask(question)
        answers += [Answer(value, why if answer.guess else None) for value, why in zip(answer.value, whys, strict=True)]
    return tuple(answers), contact


def _suggested(strokes: Sequence[Stroke], count: int, unit: str, of_force: str) -> tuple[str, list[str]]:
    """Strokes as text, one where they are the same, and why each ends there; 1 of the unit where nobody looked."""
    if not strokes:
        return f"1 {unit}", ["a first try"] * count
    amounts = [f"{short(each.reach)} {unit}" for each in strokes]
    forces = [each.force * (1000 if of_force.startswith("kPa") else 1) for each in strokes]
    whys = [f"{each.why}, at {short(force)} {of_force}" for each, force in zip(strokes, forces, strict=True)]
    return amounts[0] if len(set(amounts)) == 1 else ", ".join(amounts), whys


def _by_name(names: Sequence[str], whys: Sequence[str]) -> str:
    """One why where it is the same, else each with the names of those that it is said of."""
    if len(set(whys)) == 1:
        return whys[0]
    actuators = {
        why: ", ".join(name for name, its_why in zip(names, whys, strict=True) if its_why == why) for why in whys
    }
    return "; ".join(f"{carriers}: {why}" for why, carriers in actuators.items())


def _amounts(unit: str, count: int) -> Callable[[str], tuple[float, ...]]:
    """Reads one quantity for all actuators, or one each with commas between."""

    def read(text: str) -> tuple[float, ...]:
        values = [positive(part, unit) for part in text.split(",")]
        if len(values) not in (1, count):
            raise ValueError(f"expected one quantity for all, or {count} with commas, got '{text}'")
        return tuple(values * count if len(values) == 1 else values)

    return read
