"""How a gait is found, walked and told of."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cfem.control.crawling.crawler import Crawler, Walk
from cfem.control.crawling.gait import Gait, best_gait, commands_of
from cfem.control.crawling.spec import GaitSpec
from cfem.core.errors import NumericalError
from cfem.core.judgement import poor
from cfem.core.progress import doing, progress
from cfem.equilibrium.quasi_static import CONVERGED

APART = 0.2  # of the planned distance a cycle: a plan that is wrong by more says nothing
FEW = 2  # cycles that judge a gait, and that are walked at other coefficients of friction


@dataclass(frozen=True)
class Course:
    """What the spec says of a gait. mirrored: of each leg; n_a: actuators of a leg."""

    spec: GaitSpec
    mirrored: Sequence[bool]
    n_a: int

    @cached_property
    def direction(self) -> np.ndarray:
        """(3,) unit."""
        way = np.asarray(self.spec.direction, float)
        return way / np.linalg.norm(way)

    def walk(self, crawler: Crawler, gait: Gait, cycles: int | None = None, friction: float | None = None) -> Walk:
        """As many cycles as the spec says, at its friction, unless given."""
        spec = self.spec
        u = commands_of(gait, self.mirrored, tuple(spec.pulls), spec.steps, cycles or spec.cycles)
        doing(f"walking {len(u)} commands")
        return crawler.walk(u, spec.ground.friction if friction is None else friction)

    def best(self, learned: Crawler) -> Gait:
        """The gait that carries the learned crawler farthest. NumericalError where none carries it along."""
        spec = self.spec
        with progress("gaits are tried on the model", spec.evaluations) as advance:

            def distance(gait: Gait) -> tuple[float, float]:
                walk = self.walk(learned, gait, FEW)
                advance(1)
                least = float(walk.least.min(initial=0.0))
                return walk.per_cycle(spec.steps, self.direction), least

            best, far = best_gait(distance, self.n_a, spec.evaluations)
        if not far > 0:
            what = f"none of {spec.evaluations} gaits carries the crawler along"
            raise NumericalError(what, do="allow larger gait.pulls, more evaluations, another weight or friction")
        return best

    def at_friction(self, friction: float, gait: Gait, learned: Crawler, fe: Crawler) -> dict[str, Any]:
        """mm a cycle, planned and by finite elements, of the same gait."""
        walks = [self.walk(one, gait, FEW, friction) for one in (learned, fe)]
        planned, found = (one.per_cycle(self.spec.steps, self.direction) for one in walks)
        return {"friction": friction, "planned": planned, "fe": found, "status": walks[1].status}


def account_of(walk: Walk) -> dict[str, Any]:
    """Of contact by finite elements: points at the ends of commands, and the largest residual of law and balance."""
    points = Counter(mode.value for touch in walk.touches for mode in touch.modes)
    worst = max((touch.check.largest for touch in walk.touches), default=float("nan"))
    return {"commands": len(walk.commands), "points": dict(points), "law_residual": worst, "status": walk.status}


def judged(far: Mapping[str, float]) -> list[dict[str, Any]]:
    """Whether finite elements go as far as the plan: nobody should trust it otherwise."""
    planned, fe = far["planned"], far["fe"]
    if abs(fe - planned) <= APART * abs(planned):
        return []
    found = "do not finish the gait" if np.isnan(fe) else f"go {fe:.2g} mm a cycle"
    return [poor(f"the plan of the gait does not hold: it goes {planned:.2g} mm a cycle, finite elements {found}")]


def headline(
    far: Mapping[str, float], sweep: Sequence[Mapping], walks: Mapping[str, Walk], account: Mapping, friction: float
) -> list[str]:
    """For people."""
    planned, fe = walks["planned"], walks["fe"]
    n = min(len(planned.base), len(fe.base))
    apart = float(np.linalg.norm(planned.base[:n] - fe.base[:n], axis=1).max())
    missed = 100 * abs(far["fe"] / far["planned"] - 1)
    lines = [
        f"gait: {far['planned']:.3g} mm a cycle planned, {far['fe']:.3g} mm by finite elements ({missed:.2g} % apart, "
        f"friction {friction:g}); the base is {apart:.2g} mm from the plan at most"
    ]
    for one in sweep:
        lines.append(f"friction {one['friction']:g}: {one['planned']:.3g} mm a cycle planned, {one['fe']:.3g} mm by FE")
    points = ", ".join(f"{count} {mode}" for mode, count in sorted(account["points"].items()))
    said = f"contact: {account['commands']} commands carried out; after them points {points}"
    if fe.status != CONVERGED:
        said += f"; then: {fe.status}"
    return [*lines, f"{said}; the law is met to {account['law_residual']:.1e}"]
