"""Where cables run in a body of the catalogue, and where its free end is: places that follow its lengths."""

from typing import Any

import numpy as np

from cfem.robot.catalogue import bar, bellows, diamond, fin_ray, pneunet, pneunet_trunk, soft_finger, trunk, tube
from cfem.robot.constraints import Route

_SIDES = {f"{axis}{sign}": float(f"{sign}1") * np.eye(3)["xyz".index(axis)] for axis in "xyz" for sign in "+-"}
_ALONG_Z = ("x+", "x-", "y+", "y-")
_BODIES = {  # the module of each, and the sides along which its cables run
    bar.Bar: (bar, ("y+", "y-", "z+", "z-")),
    diamond.Diamond: (diamond, _ALONG_Z),
    trunk.Trunk: (trunk, _ALONG_Z),
    soft_finger.SoftFinger: (soft_finger, ()),
    pneunet.PneuNet: (pneunet, ()),
    pneunet_trunk.PneuNetTrunk: (pneunet_trunk, ()),
    bellows.Bellows: (bellows, ()),
    tube.Tube: (tube, ()),
    fin_ray.FinRay: (fin_ray, ()),
}
BODIES = {body.model_fields["kind"].annotation.__args__[0]: body for body in _BODIES}  # bodies with tips, by kind


def points(geometry: Any, route: Route) -> np.ndarray:
    """Points (k, 3) mm of a cable, from the base on."""
    if isinstance(geometry, soft_finger.SoftFinger):
        return soft_finger.route(geometry, route.x, route.y)
    full = _BODIES[type(geometry)][0].route(geometry, _SIDES[route.side])
    return full if route.disks is None else full[: 2 * route.disks]


def pull_point(geometry: Any, route: Route) -> np.ndarray | None:
    """Point (3,) mm from which a cable along a side is pulled; None on a soft finger, whose scene states it."""
    if isinstance(geometry, soft_finger.SoftFinger):
        return None
    return _BODIES[type(geometry)][0].pull_point(geometry, _SIDES[route.side])


def tip(geometry: Any) -> np.ndarray:
    """Point (3,) mm of the free end."""
    return _BODIES[type(geometry)][0].tip(geometry)


def has_tip(geometry: Any) -> bool:
    """True for a body whose free end, and whose routes if it has any, are known."""
    return type(geometry) in _BODIES


def fault(geometry: Any, route: Route) -> str:
    """Sentence about a route that does not go with its body, empty where it does. The body has routes."""
    kind, sides, disks = geometry.kind, _BODIES[type(geometry)][1], getattr(geometry, "disks", 0)
    if isinstance(geometry, soft_finger.SoftFinger):
        stated = route.x is not None and route.y is not None and route.side is None and route.disks is None
        return "" if stated else f"a {kind} needs x and y of the cable, and nothing else"
    if not sides:
        return f"cables through a {kind} have points, not a route"
    if route.side not in sides or route.x is not None or route.y is not None:
        return f"a {kind} needs the side of the cable, one of {', '.join(sides)}, and neither x nor y"
    if route.disks is not None and route.disks > disks:
        return f"a cable cannot pass {route.disks} disks, the {kind} has {disks or 'none'}"
    return ""
