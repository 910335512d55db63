"""An S-shaped arm of oval section, thinner towards its tip. Lengths in mm."""

from math import pi, sin

import gmsh

gmsh.initialize()
occ, rings = gmsh.model.occ, []
for share in (0, 0.2, 0.4, 0.6, 0.8, 1):
    ring = occ.addEllipse(12 * sin(2 * pi * share), 0, 120 * share, 11 - 5 * share, 8 - 3.5 * share)
    rings.append(occ.addCurveLoop([ring]))
occ.addThruSections(rings)
occ.synchronize()
gmsh.write("s-arm.step")
