"""Bodies of the zoo, drawn in mm: `python shapes.py NAME SIZE FILE...` writes each into files, by their suffix.

It uses gmsh and is run in a process of its own. .step and .brep hold the solid, .stl its surface in triangles of about
SIZE mm, .msh, .vtk and .inp its volume in tetrahedra."""

import sys
from math import cos, pi, sin

import gmsh

occ = gmsh.model.occ


def box(*numbers):
    return [(3, occ.addBox(*numbers))]


def cylinder(*numbers):
    return [(3, occ.addCylinder(*numbers))]


def union(*bodies):
    first, *others = bodies
    return occ.fuse(first, [entity for body in others for entity in body])[0] if others else first


def without(body, *others):
    return occ.cut(body, [entity for other in others for entity in other])[0]


def around(count, radius, phase=0.0):
    return [(radius * cos(phase + 2 * pi * k / count), radius * sin(phase + 2 * pi * k / count)) for k in range(count)]


def finger_holes():
    """Six walls on a backbone along x, a guide hole of 2 mm through each wall."""
    walls = [box(5 + 15 * k, -8, 0, 5, 16, 16) for k in range(6)]
    body = union(box(0, -8, 0, 90, 16, 4), *walls)
    return without(body, cylinder(-1, 0, 12, 92, 0, 0, 1.5))


def finger_channel():
    """A bar along x with a round channel near its upper side, all the way through."""
    return without(box(0, 0, 0, 90, 14, 12), cylinder(-1, 7, 9, 92, 0, 0, 1.2))


def finger_outside():
    """A thin backbone along z with discs, between which cables run through the air."""
    discs = [cylinder(0, 0, z, 0, 0, 4, 10) for z in (0, 18, 36, 54, 72)]
    return union(cylinder(0, 0, 0, 0, 0, 76, 4), *discs)


def trunk():
    """Discs and necks in turn along z, thinner towards the tip."""
    parts = []
    for k in range(7):
        wide = 12 - k
        parts += [cylinder(0, 0, 14 * k, 0, 0, 7, wide), cylinder(0, 0, 14 * k + 6, 0, 0, 9, 0.65 * wide)]
    return union(*parts)


def tentacle():
    """A cone along x."""
    return [(3, occ.addCone(0, 0, 0, 120, 0, 0, 12, 4))]


def pneunet():
    """Five bellows on a strip along x; one chamber of five rooms joined by a duct."""
    outer = union(box(0, 0, 0, 84, 16, 9), *(box(2 + 16 * k, 0, 0, 12, 16, 20) for k in range(5)))
    rooms = [box(4 + 16 * k, 2.5, 4, 8, 11, 13) for k in range(5)]
    return without(outer, union(box(5, 6, 4, 70, 4, 3), *rooms))


def bellows():
    """An accordion along z with one closed chamber."""
    outer = [cylinder(0, 0, 12 * k, 0, 0, 7, 14) for k in range(4)]
    necks = [cylinder(0, 0, 12 * k + 6, 0, 0, 7, 10) for k in range(3)]
    inner = [cylinder(0, 0, 2 + 12 * k, 0, 0, 3, 11.5) for k in range(4)] + [cylinder(0, 0, 2, 0, 0, 38, 7)]
    return without(union(*outer, *necks), union(*inner))


def three_chambers():
    """A cylinder along z with three closed chambers around its axis."""
    chambers = [cylinder(x, y, 8, 0, 0, 64, 3.5) for x, y in around(3, 7)]
    return without(cylinder(0, 0, 0, 0, 0, 80, 13), *chambers)


def ring_gripper():
    """A ring in the plane z = 0 with a closed chamber behind each of three pads, on a flange."""
    body = without(cylinder(0, 0, 0, 0, 0, 16, 32), cylinder(0, 0, -1, 0, 0, 18, 18))
    flange = without(cylinder(0, 0, -4, 0, 0, 4, 36), cylinder(0, 0, -5, 0, 0, 6, 20))
    rooms = []
    for k in range(3):
        room = box(21, -10, 4, 5, 20, 8)
        occ.rotate(room, 0, 0, 0, 0, 0, 1, 2 * pi * k / 3)
        rooms.append(room)
    return without(union(body, flange), *rooms)


def diamond():
    """Four legs from a base up to a platform, with knees that stand out."""
    legs = []
    for k in range(4):
        for low, high in (((12, 0), (40, 45)), ((40, 45), (10, 95))):
            rings = [ring(r, z) for r, z in (low, high)]
            part = [entity for entity in occ.addThruSections(rings, makeRuled=True) if entity[0] == 3]
            occ.rotate(part, 0, 0, 0, 0, 0, 1, k * pi / 2)
            legs.append(part)
    return union(box(-18, -18, -6, 36, 36, 8), box(-16, -16, 92, 32, 32, 8), *legs)


def ring(r, z):
    corners = [occ.addPoint(x, y, z) for x, y in ((r - 5, -6), (r + 5, -6), (r + 5, 6), (r - 5, 6))]
    return occ.addCurveLoop([occ.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])


def diamond_lying():
    body = diamond()
    occ.rotate(body, 0, 0, 0, 0, 1, 0, pi / 2)
    return body


def s_shape():
    """An S of oval section along z."""
    rings = []
    for share in (0, 0.2, 0.4, 0.6, 0.8, 1):
        turned = occ.addEllipse(12 * sin(2 * pi * share), 0, 100 * share, 10 - 4 * share, 8 - 3 * share)
        rings.append(occ.addCurveLoop([turned]))
    return [entity for entity in occ.addThruSections(rings) if entity[0] == 3]


def l_shape():
    return union(box(0, 0, 0, 70, 14, 14), box(0, 0, 0, 14, 60, 14))


def u_shape():
    """Two legs along z that a bow joins: the longest way turns back."""
    return union(box(0, 0, 0, 12, 12, 70), box(36, 0, 0, 12, 12, 70), box(0, 0, 58, 48, 12, 12))


def hollow():
    """A tube, open at both ends."""
    return without(cylinder(0, 0, 0, 0, 0, 80, 12), cylinder(0, 0, -1, 0, 0, 82, 7))


def lattice():
    """Struts along the edges of four cubes in a row along z."""
    side, thick, parts = 22.0, 5.0, []
    for k in range(5):
        z = side * k
        for x, y, dx, dy in ((0, 0, side, 0), (0, side, side, 0), (0, 0, 0, side), (side, 0, 0, side)):
            parts.append(box(x, y, z, dx + thick if dx else thick, dy + thick if dy else thick, thick))
    parts += [box(x, y, 0, thick, thick, 4 * side + thick) for x in (0, side) for y in (0, side)]
    return union(*parts)


def sheet():
    """A thin sheet."""
    return box(0, 0, 0, 90, 30, 4)


def bar():
    return box(0, 0, 0, 80, 16, 12)


def write(body, size, files):
    occ.synchronize()
    for _, tag in gmsh.model.getEntities(3):
        gmsh.model.addPhysicalGroup(3, [tag])
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8)  # triangles around a circle
    gmsh.option.setNumber("Mesh.Binary", 1)
    for file in files:
        suffix = file.rpartition(".")[2]
        if suffix in ("stl", "msh", "vtk", "inp"):
            gmsh.model.mesh.clear()
            if suffix == "stl":
                gmsh.model.removePhysicalGroups()
            gmsh.model.mesh.generate(2 if suffix == "stl" else 3)
        gmsh.option.setNumber("Mesh.Binary", float(suffix in ("stl", "msh")))
        gmsh.write(file)


if __name__ == "__main__":
    gmsh.initialize(["gmsh", "-nt", "1"])
    gmsh.option.setNumber("General.Terminal", 0)
    write(globals()[sys.argv[1]](), float(sys.argv[2]), sys.argv[3:])
    gmsh.finalize()
