"""Forces and weights from next to nothing to absurd."""

from functools import partial
from itertools import product

import numpy as np

from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.robot import Robot
from cfem.stability.bodies import bar, bar_body
from cfem.stability.case import AWAY, Case, converges, either
from cfem.stability.examine import attempt

TENSIONS = {
    1e-12: converges(),
    1e-6: converges(),
    1.0: converges(),
    1e2: either(*AWAY),
    1e4: either(*AWAY),
    1e9: either(*AWAY),
}  # N
WEIGHTS = {
    1e-9: converges(),
    1e-3: converges(),
    0.1: converges(),
    1.0: converges(),
    10.0: converges(),
    1e3: either(*AWAY),
    1e9: either(*AWAY),
}  # N


def cases() -> list[Case]:
    """Cases of cable forces and hanging weights."""
    listed = [
        Case(f"loads/cable {tension:g} N", expect, attempt(bar, force([tension, 0.0])))
        for tension, expect in TENSIONS.items()
    ]
    listed += [
        Case(f"loads/both cables {tension:g} N", expect, attempt(bar, force([tension, tension])))
        for tension, expect in TENSIONS.items()
    ]
    listed += [
        Case(f"loads/weight {weight:g} N/{kind}", expect, attempt(partial(_hanging, weight, kind), force([0.0, 0.0])))
        for (weight, expect), kind in product(WEIGHTS.items(), ("soft", "rigid end"))
    ]
    return listed


def _hanging(weight: float, kind: str) -> Robot:
    body = bar_body()
    rigid = (np.flatnonzero(body.mesh.X[:, 0] > 49.0),) if kind == "rigid end" else ()
    return bar(body, weight=weight, rigid=rigid)
