"""Modules in a row under loads, or of different models, in C: the row of Python, whose derivatives are tested against
differences and finite elements."""

import numpy as np
import pytest
from export.embedded import needs_compiler
from support.fast_cases import fast_are
from support.serial_rows import REST, WRENCH, chain, skinned, skins

from cfem.condensed.strokes import STEP, ridge_of, stroke
from cfem.constraint.patch import PatchLoad
from cfem.control.search.inverse import Aim, Limits, inverse_step
from cfem.export.compiled.controller import CompiledController
from cfem.export.firmware.folder import write_c
from cfem.export.spec import CSpec
from cfem.predict.load import build
from cfem.predict.loads.loaded import loaded
from cfem.predict.rows.serial_patches import with_skins

pytestmark = needs_compiler
TOLERANCE = {"double": 1e-12, "float": 1e-5}
HELD, NO_MODEL = 16, 64


def states(row, count=10):
    return np.random.default_rng(0).uniform(-1.5, 1.5, (count, row.rows.n_a))


def compiled(folder, row, **spec) -> CompiledController:
    write_c(folder, row.meta, row.arrays, CSpec(**spec), states(row))
    return CompiledController(folder)


@pytest.mark.parametrize("scalar", fast_are({"double"}, ["double", "float"]))
@pytest.mark.parametrize(
    ("wrench", "heavy", "mixed", "curved"),
    [
        (WRENCH, True, True, True),
        pytest.param(WRENCH, True, True, False, marks=pytest.mark.slow),
        pytest.param(WRENCH, False, False, True, marks=pytest.mark.slow),
        pytest.param(3 * WRENCH, True, True, True, marks=pytest.mark.slow),
        (0 * WRENCH, True, False, False),
        pytest.param(None, False, True, False, marks=pytest.mark.slow),
    ],
)
def test_it_is_the_row_of_python(tmp_path, wrench, heavy, mixed, curved, scalar):
    row = chain(wrench, heavy=heavy, mixed=mixed, curved=curved)
    steps = demand_same(compiled(tmp_path, row, scalar=scalar), row, scalar)
    loaded = wrench is not None and np.any(wrench)
    assert (2 <= min(steps) <= max(steps) <= 8) if loaded else steps == {1}


def demand_same(controller, row, scalar):
    """Newton steps that the states took."""
    steps, e, a = set(), row.rows.e, row.rows.a
    for s in states(row):
        found, here = controller.model(s), row.at(s)
        assert found["status"] == 0 and found["change"] <= 1e-11
        steps.add(int(found["steps"].item()))
        blocks = {"W_aa": here.W[a, a], "W_ea": here.W[e, a], "lambda_a": here.lam}
        blocks |= {"delta_a": s, "free_e": here.delta_free[e]}
        for name, block in blocks.items():
            off = np.abs(found[name].reshape(block.shape) - block).max()
            assert off <= TOLERANCE[scalar] * np.abs(block).max(), name
    return steps


@pytest.mark.parametrize("scalar", fast_are({"double"}, ["double", "float"]))
@pytest.mark.parametrize(("wrench", "third"), [(WRENCH, True), pytest.param(0 * WRENCH, False, marks=pytest.mark.slow)])
def test_forces_on_patches_are_those_of_python(tmp_path, wrench, third, scalar):
    """Two on one module, one on another, none on the first: of that of the first model there are two in C."""
    pushes = [(1, [0.02, -0.03, 0.04]), (2, [0.01, 0.02, 0.0]), (2, [0.0, 0.03, 0.0])]
    patches = [PatchLoad((i + 1) * REST, 4.0, force) for i, force in pushes]
    row = loaded(skinned(third, curved=third), wrench, patches, trusted=np.inf)
    row.arrays = with_skins(row.arrays, skins())
    assert min(demand_same(compiled(tmp_path, row, scalar=scalar), row, scalar)) > 1
    again = build(row.meta, row.arrays)  # as one that was exported is read
    for one, other in zip(row.evaluate(states(row)), again.evaluate(states(row)), strict=True):
        assert np.array_equal(one, other)


def test_one_without_the_change_of_compliance_beside_one_with_it(tmp_path):
    row = chain(WRENCH)
    arrays = {name: one for name, one in row.arrays.items() if name != "0.third"}
    row = type(row)(row.meta, arrays)
    s = states(row)[0]
    assert compiled(tmp_path, row).model(s)["lambda_a"] == pytest.approx(row.at(s).lam, rel=1e-12)


def test_a_load_that_it_cannot_carry_is_said(tmp_path):
    """From rest, where control begins, it knows no model: the tick holds."""
    light, much = chain(WRENCH), chain(1e3 * WRENCH)
    write_c(tmp_path, light.meta, light.arrays, CSpec(), states(light))
    text = (tmp_path / "cfem_data.c").read_text()
    before = ", ".join(map(repr, light.meta["wrench"]))
    assert before in text
    (tmp_path / "cfem_data.c").write_text(text.replace(before, ", ".join(map(repr, much.meta["wrench"]))))
    controller = CompiledController(tmp_path)
    assert controller.model(states(light)[0])["status"] == NO_MODEL
    assert controller.step(light.rest_e).status & (HELD | NO_MODEL) == HELD | NO_MODEL


def test_control_on_it_is_that_of_python(tmp_path):
    """Each tick is the inverse step at the model where the actuators are measured."""
    row = chain(WRENCH, heavy=False)
    choices = {"command": "displacement", "observer": "measured", "halvings": 0, "unilateral": False}
    controller, ridge = compiled(tmp_path, row, controller=choices), ridge_of(1e-10, row.reach, row.length)
    limits, places = Limits.of(row.reach, np.zeros(row.rows.n_a, dtype=bool)), states(row, 6)
    for s, aim in zip(places[1:], places[:-1], strict=True):
        goal, at = row.rest_e + row.at(aim).delta_e, row.at_displacement(s)
        step = inverse_step(
            at, Aim(goal - row.rest_e, np.ones(3), ridge), limits.within(at.delta_a, STEP * stroke(row.reach))
        )
        found = controller.step(goal, delta_a=s)
        assert found.status & HELD == 0
        assert found.delta_a == pytest.approx(step.delta_a, rel=1e-7, abs=1e-7)
