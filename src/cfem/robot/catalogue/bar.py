"""A plain bar along x: the smallest robot there is."""

from cfem.robot import geometry
from cfem.robot.cad import Box, Solid


def bar(spec: geometry.Bar) -> Solid:
    y, z = spec.width / 2, spec.height / 2
    return Box((0.0, -y, -z), (spec.length, y, z))
