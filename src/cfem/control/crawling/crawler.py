"""The crawler: legs, learned or finite elements, on one rigid base, and the ground that moves under it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from cfem.contact.obstacle import Plane, tangents
from cfem.control.crawling.spec import GaitSpec
from cfem.core.errors import SpecError
from cfem.equilibrium.contact.grasp import grasp_step
from cfem.equilibrium.contact.ground import Ground, Pads
from cfem.equilibrium.contact.points import PointRobot, PointsState
from cfem.equilibrium.quasi_static import CONVERGED, carried_out
from cfem.equilibrium.system.actuation import displacement

# Share of the range of the commands that an actuator goes in one quasi-static step, on which friction depends: where
# half of it changes the way, the plan says so (docs/locomotion.md).
STEP = 1 / 16
INSIDE = 1e-6  # mm


@dataclass(frozen=True)
class Walk:
    """Commands that a crawler has carried out, and where they took it.

    commands: (n, n_a) mm
    base: (n + 1, 3) mm, the base's centre over the ground, at first and after each command
    turns: (n + 1, 3, 3) of the base
    least: (n,) N, smallest force of an actuator
    touches: the contact states
    seconds: (n,) that each command took
    status: 'converged', or why the walk ended"""

    commands: np.ndarray
    base: np.ndarray
    turns: np.ndarray
    least: np.ndarray
    touches: tuple[PointsState, ...]
    seconds: np.ndarray
    status: str

    def per_cycle(self, steps: int, direction: np.ndarray) -> float:
        """Distance (mm) along `direction` in a cycle of `steps` commands, the mean of all but the first; NaN where the
        walk ended."""
        cycles = (len(self.base) - 1) // steps
        if self.status != CONVERGED or cycles < 2:
            return float("nan")
        return float((self.base[cycles * steps] - self.base[steps]) @ direction) / (cycles - 1)

    def travelled(self, direction: np.ndarray) -> float:
        """Distance (mm) along `direction` since rest; NaN where the walk ended before."""
        return float((self.base[-1] - self.base[0]) @ direction) if self.status == CONVERGED else float("nan")


@dataclass(frozen=True)
class LegWeight:
    """Weight of a leg.

    size: N
    rest: (3,) mm, its centre of mass at rest, in the scene
    turn: (3, 3) of the leg"""

    size: float
    rest: np.ndarray
    turn: np.ndarray


@dataclass(frozen=True)
class Crawler:
    """Legs on a base that stands on the ground.

    pads: of the base
    centre: (3,) mm of the base
    ground: under the base alone
    longest: mm that an actuator goes in one quasi-static step
    weights: of the legs, none where they have none"""

    legs: tuple[PointRobot, ...]
    pads: Pads
    ground: Ground
    centre: np.ndarray
    longest: float
    weights: tuple[LegWeight, ...] = ()

    def _ground(self, last: PointsState | None) -> Ground:
        """The ground, with the weight of base and legs at their common centre of mass; the legs are as in the state
        `last`, at rest without one."""
        if not self.weights:
            return self.ground
        solved = [None] * len(self.weights) if last is None else last.solved
        centres = [
            weight.rest if leg is None else weight.rest + weight.turn @ leg.delta_e
            for weight, leg in zip(self.weights, solved, strict=False)
        ]
        base = float(np.linalg.norm(self.ground.load[:3]))
        sizes = np.array([base, *(weight.size for weight in self.weights)])
        total = sizes.sum()
        mass_at = sizes @ np.array([self.centre, *centres]) / total
        return replace(self.ground, load=self.ground.load * total / base, mass_at=mass_at)

    def walk(self, commands: np.ndarray, mu: float, enough: Callable[[np.ndarray], bool] | None = None) -> Walk:
        """Carries out commands (n, legs n_a) mm from rest, in quasi-static steps, until one after which the base
        is where it is `enough`."""
        sent, last = np.zeros(commands.shape[1]), None
        touches, places, turns, least, seconds = [], [self.centre], [np.eye(3)], [], []

        def go(u: np.ndarray) -> str:
            """One step to commands u, kept where it converges."""
            nonlocal sent, last
            parts = [displacement(part) for part in (*np.split(u, len(self.legs)), np.zeros(0))]
            state = grasp_step((*self.legs, self.pads), parts, self._ground(last), "coulomb", mu, last)
            if state.converged:
                sent, last = u, state
            return state.status.value

        status = go(sent)
        for command in commands:
            begin = perf_counter()
            if status == CONVERGED:
                status = carried_out(sent, command, self.longest, go)
            if status != CONVERGED:
                break
            touches.append(last)
            seconds.append(perf_counter() - begin)
            places.append(last.around.base_at(self.centre[None])[0])
            turns.append(last.around.R.T)
            least.append(min(leg.lambda_a.min() for leg in last.solved[:-1]))
            if enough is not None and enough(places[-1]):
                break
        done = np.array(commands[: len(touches)])
        return Walk(done, np.array(places), np.array(turns), np.array(least), tuple(touches), np.array(seconds), status)


def crawler_of(
    gait: GaitSpec, legs: Sequence[PointRobot], names: Sequence[str], weights: Sequence[LegWeight] = ()
) -> Crawler:
    """Crawler of these legs on the spec's base and ground. SpecError where it starts inside the ground, or its base
    does not stand on it."""
    n = np.asarray(gait.ground.normal, float)
    n /= np.linalg.norm(n)
    plane = Plane(R=_standing(n), t=np.array(gait.ground.point))
    base = gait.base
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
    corners = np.asarray(base.centre) + signs * base.half_size
    gaps = plane.distance(corners)
    for name, leg in zip(names, legs, strict=True):
        deep = -plane.distance(leg.points).min()
        if deep > INSIDE:
            do = "move the ground, or turn its normal out of it"
            raise SpecError(
                f"the crawler starts inside the ground: '{name}' is {deep:.3g} mm in it", where="gait.ground", do=do
            )
    if gaps.min() < -INSIDE:
        what = f"the crawler starts inside the ground: its base is {-gaps.min():.3g} mm in it"
        raise SpecError(what, where="gait.ground", do="move the ground, or turn its normal out of it")
    down = corners[gaps < gaps.min() + INSIDE]
    if gaps.min() > INSIDE or len(down) < 3:
        what = f"the base does not stand on the ground: it is {gaps.min():.3g} mm above it on {len(down)} corners"
        raise SpecError(what, where="gait.ground", do="let one side of the base lie on the ground")
    weight = np.concatenate([base.weight * n, np.zeros(3)])
    centre = np.asarray(base.centre, float)
    ground = Ground(plane, plane.t, weight, mass_at=centre)
    longest = STEP * (gait.pulls[1] - gait.pulls[0])
    return Crawler(tuple(legs), Pads(down, base.pads), ground, centre, longest, tuple(weights))


def _standing(normal: np.ndarray) -> np.ndarray:
    n, t1, t2 = tangents(normal[None])[0]
    return np.stack([t1, t2, n], axis=1)
