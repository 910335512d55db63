"""What becomes of a body where gmsh's process fails."""

import signal

import meshio
import pytest
from support.blocks import block

from cfem.core.errors import InputError, NumericalError
from cfem.robot.cad import Box, File, SurfaceSolid, as_data
from cfem.robot.mesh import ask_gmsh

BOX = Box((0, 0, 0), (3, 1, 1))


@pytest.fixture
def surface(tmp_path):
    mesh = block((3, 1, 1), (3, 1, 1))
    meshio.write(tmp_path / "box.stl", meshio.Mesh(mesh.X, [("triangle", mesh.facets)]), binary=False)
    return SurfaceSolid(str(tmp_path / "box.stl"), 1.0)


def failing(monkeypatch, codes):
    """The jobs that are asked for; gmsh's process ends with these codes, then as it would."""
    asked, true = [], ask_gmsh._run

    def run(job, folder):
        asked.append(job)
        return (codes[len(asked) - 1], "what(): lost") if len(asked) <= len(codes) else true(job, folder)

    monkeypatch.setattr(ask_gmsh, "_run", run)
    return asked


def test_a_surface_of_which_gmsh_crashes_is_meshed_by_other_sizes_then_as_it_is(monkeypatch, surface):
    asked = failing(monkeypatch, [-6, 11, -6])
    job = {"solid": as_data(surface), "size": 1.0, "refine": [], "regions": [], "grading": None, "max_cells": 1000}
    answer = ask_gmsh.ask_gmsh(job, surface)
    assert len(answer["cells"]) and answer["volume"] == pytest.approx(3)
    assert [(job["factor"], job["anew"]) for job in asked] == [(1.0, True), (0.95, True), (1.05, True), (1.0, False)]


def test_what_fails_in_every_way_is_an_error(monkeypatch, surface):
    asked = failing(monkeypatch, [-6] * 4)
    with pytest.raises(InputError, match=r"box.stl: cannot be meshed: what\(\): lost"):
        ask_gmsh.ask_gmsh({"solid": as_data(surface), "size": None}, surface)
    assert len(asked) == 4


def test_another_geometry_fails_at_once(monkeypatch):
    asked = failing(monkeypatch, [11])
    with pytest.raises(NumericalError, match="cannot be meshed"):
        ask_gmsh.ask_gmsh({"solid": as_data(BOX), "size": None}, BOX)
    assert len(asked) == 1


def test_cad_that_gmsh_never_ends_with_gets_edges_around_what_bends_tightly(monkeypatch):
    asked = failing(monkeypatch, [-signal.SIGXCPU, 11, 11])
    file = File("finger.step", 1.0)
    with pytest.raises(InputError, match=r"finger.step: cannot be meshed: what\(\): lost"):
        ask_gmsh.ask_gmsh({"solid": as_data(file), "size": 4.0}, file)
    assert [job["around"] for job in asked] == [0, 6, 10]
    assert [job["patience"] for job in asked] == [1, 1, 20]
