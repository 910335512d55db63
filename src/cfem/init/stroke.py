"""How far each actuator of a robot goes, found by solving: until the body is strained or bent to a limit, has softened
or meets itself, a chamber's pressure falls while it grows, or a solve fails, as where the body buckles."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from cfem.constraint.cable import Cable
from cfem.constraint.surface import triangulated
from cfem.contact.surface.crossing import crossings
from cfem.contact.surface.overlap import ALLOWED, boundary_of
from cfem.core.errors import SpecError
from cfem.equilibrium.fields import Strain
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium, Status
from cfem.init.question import Answer, Ask, Question, choice
from cfem.robot.self_contact import SelfContactSpec, touching_itself

STRAIN = 0.5  # largest principal stretch less one, as a mean of high power over the body
BEND = np.pi / 2  # rad by which the tip turns
SOFT = 0.25  # of the stiffness d lambda / d delta that a cable or a push meets first: a limb gives way to it
_POWER = 8.0
_FIRST = {"mm": 0.01, "mm^3": 0.02}  # of the length of a cable, of the volume of a chamber
_LEAST = 1e-3  # of the first amount, below which nothing is tried
_MOST = {"mm": 0.35, "mm^3": 3.0}
_GROWTH = 1.7
_TIP = 0.1  # of the robot's length: nodes so near to the watched point turn with it
_ELSEWHERE = 0.3  # of the robot's length from the watched point: a cable that ends so far from it turns another part
_ALL = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)  # shares of the strokes tried in turn where all actuators go together
_HALVINGS = 3  # of the interval between a share that is reached and the first that is not
MARGIN = 0.8  # of where a solve fails or the body meets itself: on another mesh it folds elsewhere
_ALIKE = 0.8  # of a stroke: one that is no shorter than this is taken for both, as of cables that are alike by symmetry
# The last amount that was reached counts, so that the exact place where a path ends is worth no steps.
_CLOSE = 0.2  # of the smallest amount at which the body meets itself: so near to it is near enough
_MEETS = "beyond it, the body meets itself"
WORTH = 1.25  # times the stroke: what self-contact must gain to be suggested
_FALLS = "beyond it, the pressure falls while the volume grows"
_TOUCHES = "; its surface touches itself from the start, which is left out of account"
# Where all together buckle the body, pulls of several are drawn back (`cfem.sample.plan.borne`), and strokes are not.
_REACHED = (Status.CONVERGED, Status.UNSTABLE, Status.BIFURCATION)
_LOOSE = NewtonSettings(tolerance=1e-6, smallest_step=0.1)


@dataclass(frozen=True)
class Stroke:
    """reach: mm (mm^3 of a chamber); force: N (MPa) there; why: what says stop, in words; sudden: whether a solve fails
    or the body meets itself there; touches: whether it does from the start, as at a slit of no width, so that this says
    nothing."""

    reach: float
    force: float
    why: str
    sudden: bool = False
    touches: bool = False

    @property
    def meets(self) -> bool:
        """True where the body meets itself at its end."""
        return self.why.startswith(_MEETS)

    def shortened(self, share: float, why: str = "") -> "Stroke":
        """A share of the stroke, and why."""
        return replace(self, reach=share * self.reach, force=share * self.force, why=self.why + why)


def find_strokes(robot: Robot, advance: Callable[[int], None] = lambda _: None) -> list[Stroke]:
    """Strokes of all actuators, each alone. How far all can go at once is found where states are drawn.
    advance: called after each solve."""
    problem = Problem(robot)
    units = [unit for unit, _ in robot.actuator_units]
    alone = equalised([_alone(problem, index, advance) for index in range(robot.rows.n_a)], units)
    alone = [each.shortened(MARGIN) if each.sudden else each for each in alone]
    if len(alone) < 2:
        return alone
    reach, touches = np.array([each.reach for each in alone]), any(each.touches for each in alone)
    pulls = np.array([each.force for each in alone])  # in this proportion, so that unlike ones come about as far
    pulls = pulls if pulls.all() else 1 / reach
    inflated = "mm^3" in units

    def reached(share: float) -> bool:
        together = Actuation((pulls / (pulls @ reach))[None], np.array([share]), np.zeros(len(reach)))
        ended = solve(problem, together, settings=_LOOSE, wanted=Wanted(condense=inflated))
        advance(1)
        if ended.status not in _REACHED or (inflated and _past_the_top(ended, pulls)):
            return False
        return touches or not _meets_itself(problem, ended)

    share = _up_to(reached)
    if share == 1.0:
        return alone
    why = "; less, as all actuators cannot go so far at once"
    return [each.shortened(share, why) for each in alone]


def _up_to(reached: Callable[[float], bool]) -> float:
    """Share up to which every one is reached, to an eighth of a step. A larger one may be reached again, on another
    branch beyond the load at which the body buckles: whether a solve finds it is a matter of the mesh."""
    low = 0.0
    for high in _ALL:
        if not reached(high):
            break
        low = high
    else:
        return 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if reached(middle) else (low, middle)
    return low or high


def with_contact(
    robot: Robot, ask: Ask, asked: bool, advance: Callable[[int], None]
) -> tuple[list[Stroke], Answer | None]:
    """Strokes, and whether walls that meet push each other (yes, no), None where nobody was asked: where the body meets
    itself, walls face each other, and all actuators go as far with contact, and one WORTH farther; or where an option
    says it (asked). SpecError where it says yes and no walls face each other."""
    strokes = find_strokes(robot, advance)
    if not asked and not any(each.meets for each in strokes):
        return strokes, None
    pushed, why, default = strokes, "walls that face each other across a narrow gap", "yes"
    try:
        body = touching_itself(SelfContactSpec(), robot.body, robot.length)
    except SpecError as error:
        body, why, default = None, error.what, "no"
    if body is not None:
        pushed = find_strokes(replace(robot, body=body), advance)
        gains = [after.reach / before.reach for before, after in zip(strokes, pushed, strict=True)]
        if max(gains) < WORTH or min(gains) < 1:
            default, why = "no", "the actuators go no farther with it"
    if not asked and default == "no":
        return strokes, None
    text = "Do walls that face each other push each other (yes, no)?"
    answer = ask(Question("self-contact", text, default, why, lambda text: choice(text, ("yes", "no"))))
    if answer.value == "no":
        return strokes, answer
    if body is None:
        raise SpecError(why, where="--self-contact", do="say --self-contact no")
    return pushed, answer


def equalised(strokes: Sequence[Stroke], units: Sequence[str]) -> list[Stroke]:
    """Those that are nearly as long as a shorter one of the same unit have that in its place."""
    chosen = list(strokes)
    for unit in set(units):
        least = None
        same = [place for place, of_place in enumerate(units) if of_place == unit]
        for place in sorted(same, key=lambda place: strokes[place].reach):
            if least is None or strokes[place].reach * _ALIKE > least.reach:
                least = strokes[place]
            chosen[place] = least
    return chosen


def _alone(problem: Problem, index: int, advance: Callable[[int], None]) -> Stroke:
    ends = _ends(problem.robot, index)
    stroke = _until(problem, index, ends, advance, meets=True)
    if not stroke.touches:
        return stroke
    stroke = _until(problem, index, ends, advance, meets=False)
    return replace(stroke, why=stroke.why + _TOUCHES, touches=True)


def _ends(robot: Robot, index: int) -> dict[str, np.ndarray]:
    """Nodes whose turn counts, by what they are: those about the tip, and about the end of a cable that ends far from
    it, as in another leg of a gripper."""
    ends = {"the tip": _nodes_about(robot, robot.rest_e[:3])}
    cable = robot.actuators[index]
    if isinstance(cable, Cable):
        weights = np.maximum(cable.along[-1], 0.0)  # of its last point, where the one before has others
        end = weights @ robot.X[cable.nodes] / weights.sum()
        if np.linalg.norm(end - robot.rest_e[:3]) > _ELSEWHERE * robot.length:
            ends["the end of its cable"] = _nodes_about(robot, end)
    return ends


def _nodes_about(robot: Robot, place: np.ndarray) -> np.ndarray:
    near = np.linalg.norm(robot.X - place, axis=1)
    return near.argsort()[: max(8, int((near < _TIP * robot.length).sum()))]


def _until(
    problem: Problem, index: int, ends: Mapping[str, np.ndarray], advance: Callable[[int], None], meets: bool
) -> Stroke:
    """meets: whether the body must not meet itself."""
    robot = problem.robot
    row, unit = robot.actuators[index], robot.actuator_units[index][0]
    inflated = unit == "mm^3"  # chambers soften as they grow, as balloons do, and are followed to the largest pressure
    rest_size = getattr(row, "rest_volume", None) or getattr(row, "rest_length", None) or robot.length
    C = np.eye(robot.rows.n_a)[[index]]
    amount, most = _FIRST[unit] * rest_size, _MOST[unit] * rest_size
    done, force, before, state, first, last = 0.0, 0.0, 0.0, None, None, None
    while True:
        target = Actuation(C, np.array([amount]), np.zeros(robot.rows.n_a))
        ended = solve(problem, target, state, state, _LOOSE, slack=False, wanted=Wanted())
        advance(1)
        if ended.status is not Status.CONVERGED:
            if done == 0.0 and amount > _LEAST * _FIRST[unit] * rest_size:
                amount /= 4
                continue
            return Stroke(done or amount, force, f"beyond it, {_short(ended.status)}", sudden=True)
        if meets and _meets_itself(problem, ended):
            most = amount
            if most - done < _CLOSE * most or most < _LEAST * _FIRST[unit] * rest_size:
                return Stroke(done or most, force, _MEETS, sudden=True, touches=done == 0.0)
            amount = (done + most) / 2
            continue
        used, why = _used(problem, ended, ends)
        stiffness = 1.0 / float(ended.condensed.W_aa[index, index])
        first = first or stiffness
        end_force = float(abs(ended.state.lam[index]))
        falls = inflated and (stiffness < 0 or end_force < force)
        if not inflated:
            lost = np.log(max(stiffness / first, SOFT**4)) / np.log(SOFT)  # it falls by factors where a limb buckles
            used, why = max((used, why), (float(lost), f"softened to {100 * SOFT:.0f} % of its stiffness"))
        share = (1.0 - before) / (used - before) if used >= 1.0 else np.inf
        if falls:
            largest, pressure = _largest((done, force, last or 2 * end_force / amount), (amount, end_force, stiffness))
            if largest <= done + share * (amount - done):
                return Stroke(largest, pressure, _FALLS, sudden=True)
        if used >= 1.0:
            return Stroke(done + share * (amount - done), force + share * (end_force - force), why)
        done, force, before, state, last = amount, end_force, used, ended.state, stiffness
        if most < _MOST[unit] * rest_size:
            amount = (done + most) / 2
            continue
        if amount >= most:
            return Stroke(most, force, f"{100 * _MOST[unit]:.0f} % of its {'volume' if unit == 'mm^3' else 'length'}")
        amount = min(most, amount * min(_GROWTH, max(1.15, 1.05 / max(used, 1e-3))))


def _past_the_top(ended: Equilibrium, pulls: np.ndarray) -> bool:
    """True where less of the pulls (n_a,) takes the actuators farther along them."""
    return ended.condensed is not None and bool(pulls @ ended.condensed.W_aa @ pulls < 0)


def _largest(before: tuple[float, float, float], after: tuple[float, float, float]) -> tuple[float, float]:
    """Volume and pressure where it is largest between two states, (volume, pressure, stiffness) each: of the cubic
    through them."""
    path = CubicHermiteSpline(*np.transpose([before, after]))
    tops = [root for root in path.derivative().roots(extrapolate=False) if path(root, 2) < 0]
    top = min(tops, default=before[0])
    return float(top), float(path(top))


def _meets_itself(problem: Problem, ended: Equilibrium) -> bool:
    """True where the surface passes through itself, more than at rest, as where a slit has closed; with self-contact,
    deeper than sampling allows."""
    facets = triangulated(problem.robot.body.mesh.facets)
    if problem.body.contact is not None:
        return boundary_of(problem.rest, facets).overlap(ended.state.x).depth > ALLOWED * problem.robot.length
    count = len(crossings(ended.state.x, facets)[0])
    return count > 0 and count > len(crossings(problem.rest, facets)[0])


def _used(problem: Problem, ended: Equilibrium, ends: Mapping[str, np.ndarray]) -> tuple[float, str]:
    """The largest share of a limit that a state has come to, and which."""
    strain = _strain(problem, problem.evaluate(ended.state.x, ended.state.pressure, ended.state.load))
    shares = {f"strained by {100 * STRAIN:.0f} %": strain / STRAIN}
    for name, nodes in ends.items():
        X, x = problem.robot.X[nodes], ended.state.x[nodes]
        turn = Rotation.align_vectors(x - x.mean(axis=0), X - X.mean(axis=0))[0].magnitude()
        shares[f"turns {name} by {np.degrees(BEND):.0f} degrees"] = turn / BEND
    why = max(shares, key=shares.get)
    return shares[why], why


def _strain(problem: Problem, evaluation: Evaluation) -> float:
    return Strain(_POWER).value(problem, evaluation)


def _short(status: Status) -> str:
    """The first words of what a person reads about a status."""
    return status.value.partition(":")[0]
