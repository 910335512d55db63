"""Course of a gait run: the gait is found, walked and reported."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cfem.control.crawling.crawler import Crawler, Walk
from cfem.control.crawling.gait import Gait, best_gait, commands_of
from cfem.control.crawling.spec import GaitSpec
from cfem.core.artefact.judgement import poor
from cfem.core.console.progress import doing, progress
from cfem.core.errors import NumericalError
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.predict.loads.wrench_series import NEAR

APART = 0.2  # of the planned distance a cycle: a plan that is wrong by more says nothing
FEW = 2  # cycles that judge a gait, and that are walked at other coefficients of friction
MOST = 100  # cycles that a stated distance may need


@dataclass(frozen=True)
class Course:
    """Gait of a spec, as it is planned and judged.

    mirrored: of each leg
    n_a: actuators of a leg"""

    spec: GaitSpec
    mirrored: Sequence[bool]
    n_a: int

    @cached_property
    def direction(self) -> np.ndarray:
        """Direction (3,) of the walk, of unit length."""
        direction = np.asarray(self.spec.direction, float)
        return direction / np.linalg.norm(direction)

    def walk(self, crawler: Crawler, gait: Gait, cycles: int | None = None, friction: float | None = None) -> Walk:
        """Walk of a gait, as many cycles as the spec says and at its friction unless given."""
        spec = self.spec
        u = commands_of(gait, self.mirrored, tuple(spec.pulls), spec.steps, cycles or spec.cycles)
        doing(f"walking {len(u)} commands")
        return crawler.walk(u, spec.ground.friction if friction is None else friction)

    def tried(self, learned: Crawler, gait: Gait) -> tuple[float, float]:
        """Distance of a gait in mm a cycle, NaN where it ends before, and the smallest force of an actuator (N), 0 at
        most."""
        walk = self.walk(learned, gait, FEW)
        return walk.per_cycle(self.spec.steps, self.direction), float(walk.least.min(initial=0.0))

    def best(self, learned: Crawler) -> Gait:
        """The gait that carries the learned crawler farthest. NumericalError where none carries it along."""
        spec = self.spec
        with progress("gaits are tried on the model", spec.evaluations) as advance:

            def distance(gait: Gait) -> tuple[float, float]:
                advance(1)
                return self.tried(learned, gait)

            best, far = best_gait(distance, self.n_a, spec.steps, spec.evaluations)
        if not far > 0:
            what = f"none of {spec.evaluations} gaits carries the crawler along"
            raise NumericalError(what, do="allow larger gait.pulls, more evaluations, another weight or friction")
        return best

    def plan(self, learned: Crawler, gait: Gait) -> Walk:
        """The walk that finite elements are to repeat. NumericalError where a stated distance is not gone."""
        spec, direction = self.spec, self.direction
        if spec.distance is None:
            return self.walk(learned, gait)
        u = commands_of(gait, self.mirrored, tuple(spec.pulls), spec.steps, MOST)
        doing(f"walking {spec.distance:g} mm")
        start = learned.centre
        walk = learned.walk(u, spec.ground.friction, lambda base: float((base - start) @ direction) >= spec.distance)
        if walk.status == CONVERGED and not walk.travelled(direction) >= spec.distance:
            what = f"the gait goes {walk.travelled(direction):.3g} mm in {MOST} cycles, not {spec.distance:g} mm"
            raise NumericalError(what, where="gait.distance", do="take a smaller one, or more evaluations")
        return walk

    def repeat(self, fe: Crawler, planned: Walk) -> Walk:
        """Walk of the planned commands by finite elements."""
        doing(f"walking {len(planned.commands)} commands by finite elements")
        return fe.walk(planned.commands, self.spec.ground.friction)

    def in_half_steps(self, learned: Crawler, planned: Walk) -> Walk:
        """The planned commands in steps of half the length on the model. Friction depends on the way between commands,
        so that a plan whose steps are too long is one of nothing, though finite elements repeat it."""
        doing(f"walking {len(planned.commands)} commands in half steps")
        return in_half_steps(learned).walk(planned.commands, self.spec.ground.friction)

    def distance(self, walk: Walk) -> float:
        """Distance that judges a walk: mm since rest where the spec states a distance, else mm a cycle."""
        if self.spec.distance is None:
            return walk.per_cycle(self.spec.steps, self.direction)
        return walk.travelled(self.direction)

    @property
    def unit(self) -> str:
        return "mm a cycle" if self.spec.distance is None else "mm"

    def at_friction(self, friction: float, gait: Gait, learned: Crawler, fe: Crawler | None = None) -> dict[str, Any]:
        """Distances of the same gait at a friction, in mm a cycle: planned, planned in half steps, and by finite
        elements where they are given; and how the last of these walks ended."""
        crawlers = {"planned": learned, "half_steps": in_half_steps(learned)} | ({"fe": fe} if fe else {})
        walks = {name: self.walk(crawler, gait, FEW, friction) for name, crawler in crawlers.items()}
        distances = {name: known(walk.per_cycle(self.spec.steps, self.direction)) for name, walk in walks.items()}
        return {"friction": friction, **distances, "status": walks["fe" if fe else "planned"].status}


def in_half_steps(crawler: Crawler) -> Crawler:
    """The crawler in quasi-static steps of half the length."""
    return replace(crawler, longest=crawler.longest / 2)


def account_of(walk: Walk) -> dict[str, Any]:
    """Account of contact by finite elements: points at the ends of commands, and the largest residual of law and
    balance."""
    points = Counter(mode.value for touch in walk.touches for mode in touch.modes)
    worst = max((touch.check.largest for touch in walk.touches), default=0.0)
    return {"commands": len(walk.commands), "points": dict(points), "law_residual": worst, "status": walk.status}


def known(value: float) -> float | None:
    """None for NaN, which files do not hold."""
    return None if np.isnan(value) else value


def judged(far: Mapping[str, float], unit: str, ratio: float = 0.0) -> list[dict[str, Any]]:
    """Findings about a gait: the plan goes another distance in half steps, finite elements do not go as far as the
    plan, or the legs hardly bear what they carry. far: distances planned, planned in half steps, and by finite elements
    (fe); ratio: the largest of `cfem.predict.loads.wrench_series.Loaded.ratio` in the plan."""
    planned, halved, fe = far["planned"], far["half_steps"], far["fe"]
    findings = []
    if not (np.isnan(planned) or abs(halved - planned) <= APART * abs(planned)):
        gone = "it does not come to its end" if np.isnan(halved) else f"{halved:.2g}"
        findings.append(poor(f"the plan depends on its steps: it goes {planned:.2g} {unit}, in half steps {gone}"))
    if not abs(fe - planned) <= APART * abs(planned):
        gone = "do not finish the gait" if np.isnan(fe) else f"go {fe:.2g} {unit}"
        findings.append(
            poor(f"the plan of the gait does not hold: it goes {planned:.2g} {unit}, finite elements {gone}")
        )
    if ratio > NEAR:
        findings.append(poor("a leg is nearer to buckling under what it carries than the model can know"))
    return findings


def headline(
    far: Mapping[str, float],
    unit: str,
    sweep: Sequence[Mapping],
    walks: Mapping[str, Walk],
    account: Mapping,
    friction: float,
    outside: int,
    alone: Sequence[Mapping] = (),
) -> list[str]:
    """Lines about a gait for people. outside: planned states that are not like those that the model was trained on;
    alone: frictions at which the model alone walks."""
    planned, fe = walks["planned"], walks["fe"]
    n = min(len(planned.base), len(fe.base))
    apart = float(np.linalg.norm(planned.base[:n] - fe.base[:n], axis=1).max())
    line = f"gait: {far['planned']:.3g} {unit} planned, "
    if np.isnan(far["fe"]):
        line += f"NOT walked to the end by finite elements (friction {friction:g})"
    else:
        missed = 100 * abs(far["fe"] / far["planned"] - 1)
        line += f"{far['fe']:.3g} mm by finite elements ({missed:.2g} % apart, friction {friction:g})"
    if not np.isnan(far["half_steps"]):
        changed = 100 * abs(far["half_steps"] / far["planned"] - 1)
        line += f"; half steps change the plan by {changed:.2g} %"
    line += f"; the base is {apart:.2g} mm from the plan at most"
    if outside:
        line += f"; {outside} of {len(planned.commands)} plans OUTSIDE what the model was trained on"
    lines = [line]
    for row in sweep:
        by_fe = _a_cycle(row["fe"], " mm")
        lines.append(f"friction {row['friction']:g}, a cycle: {_planned(row, ' mm')} planned, {by_fe} by FE")
    if alone:
        text = ", ".join(f"{_planned(row)} at {row['friction']:g}" for row in alone)
        lines.append(f"planned alone, mm a cycle at a friction: {text}")
    points = ", ".join(f"{count} {mode}" for mode, count in sorted(account["points"].items()))
    text = f"contact: {account['commands']} commands carried out; contact points at their ends: {points}"
    if fe.status != CONVERGED:
        text += f"; then: {fe.status}"
    return [*lines, f"{text}; the law is met to {account['law_residual']:.1e}"]


def _planned(row: Mapping[str, Any], unit: str = "") -> str:
    """Distance that is planned at a friction, beside that in half steps where the two are apart."""
    planned, halved = row["planned"], row["half_steps"]
    apart = planned is not None and (halved is None or abs(halved - planned) > APART * abs(planned))
    return _a_cycle(planned, unit) + (f" (in half steps {_a_cycle(halved, unit)})" if apart else "")


def _a_cycle(distance: float | None, unit: str = "") -> str:
    return "no whole cycle" if distance is None else f"{distance:.3g}{unit}"
