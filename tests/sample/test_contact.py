"""States of a bar whose contact point is held, drawn with its cables' forces."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed.pose import onto_patch
from cfem.dataset.reader import as_dataset
from cfem.equilibrium.contact.held_patch import contact_points, patch_of
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.sample.runner import sample
from cfem.sample.solver import Facts, row_units
from cfem.sample.spec import SampleSpec
from cfem.surrogate.series.spectral import fit

SPEC = {
    "scene": "s",
    "mesh": "m",
    "out": "o",
    "skeleton": 3,
    "third_order": True,
    "splits": {"train": {"rows": 24, "method": "scrambled-halton", "seed": 1}},
    "contact": {"translation": {"mm": [[-0.2, 0.2], [-0.3, 0.3], [0.0, 0.5]]}, "force": "2 mN"},
}


class BarSolver:
    def __init__(self):
        robot = bar(element="tet4", divisions=(4, 1, 1), cables=2, contact=True)
        self.problem = Problem(robot)
        self.rotation_strain = self.problem.rotation_strain
        patch = patch_of(contact_points(self.problem), False)
        rows = replace(robot.rows, contacts=patch.names)
        units = row_units(robot, False)
        rest = solve(self.problem, force(np.zeros(2))).condensed
        at_rest = onto_patch(rest, patch, np.zeros(patch.n))
        W = at_rest.W[at_rest.rows.active, at_rest.rows.active]
        self.facts = Facts("bar", rows, robot.reach, robot.rest_e, robot.length, W, (), units, patch)

    def solve(self, actuation, start, p):
        return solve(
            self.problem, actuation, start, settings=NewtonSettings(tolerance=1e-11), wanted=Wanted(third_order=True)
        )


@dataclass(frozen=True)
class Factory:
    def __call__(self):
        return BarSolver()


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    with ThreadPoolExecutor(1) as executor:
        return sample(SampleSpec(**SPEC), Factory(), tmp_path_factory.mktemp("rows"), executor)["train"]


def test_rows_have_the_pose_and_the_wrench_and_stay_in_the_box(table):
    pose, wrench = np.array(table["delta_c"].to_pylist()), np.array(table["lambda_c"].to_pylist())
    assert pose.shape == wrench.shape == (24, 3)
    assert (pose >= [-0.2, -0.3, 0.0]).all() and (pose <= [0.2, 0.3, 0.5]).all() and np.ptp(pose[:, 2]) > 0.3
    forces = np.array(table["lambda_a"].to_pylist())
    assert (forces >= 0).all() and (forces <= 2e-3).all() and forces.max() > 1.5e-3


def test_a_reader_sees_one_energy_of_actuators_and_pose(table):
    """Its differences from row to row are the work of lambda, by the trapezoidal rule, less what W says it bends."""
    data = as_dataset(table)
    assert data.n_c == 3 and data.rows.actuators[2:] == ("patch.x", "patch.y", "patch.z")
    a = data.rows.a
    middle = np.argmin(((data.delta_a - data.delta_a.mean(axis=0)) ** 2).sum(axis=1))
    steps = data.delta_a - data.delta_a[middle]
    near = np.argsort((steps**2).sum(axis=1))[1:4]
    for i in near:
        work = (data.lambda_a[i] + data.lambda_a[middle]) @ steps[i] / 2
        bend = steps[i] @ (np.linalg.inv(data.W[i, a, a]) - np.linalg.inv(data.W[middle, a, a])) @ steps[i] / 12
        assert data.energy[i] - data.energy[middle] == pytest.approx(work - bend, rel=1e-3, abs=1e-8)


def test_the_energy_model_takes_them_as_inputs(table):
    found = fit(as_dataset(table), max_degree=4)
    assert found.arrays["indices"].shape[1] == 5
    assert found.held_out[-1]["error"] < 0.2


@pytest.mark.parametrize(
    "change, says",
    [
        ({"translation": {"mm": [[0, 1], [0, 1]]}, "force": "1 N"}, "three ranges"),
        ({"translation": {"mm": [[0, 1], [0, 1], [1, 0]]}, "force": "1 N"}, "three ranges"),
    ],
)
def test_a_box_without_room_is_refused(change, says):
    with pytest.raises(ValueError, match=says):
        SampleSpec(**{**SPEC, "contact": change})


def test_an_axis_about_its_rest_hardly_carries_anything(tmp_path):
    """Drawn within a micrometre of where it would rest, to first order, z carries far less than drawn freely."""
    pulled = {}
    for name, more in {"free": {}, "about": {"about_rest": ["z"]}}.items():
        ranges = [[-0.02, 0.02], [-0.02, 0.02], [-0.05, 0.05] if name == "free" else [-1e-6, 1e-6]]
        contact = {"translation": {"mm": ranges}, "force": "0.5 mN", **more}
        with ThreadPoolExecutor(1) as executor:
            spec = SampleSpec(**{**SPEC, "third_order": False, "contact": contact})
            table = sample(spec, Factory(), tmp_path / name, executor)["train"]
        pulled[name] = np.abs(np.array(table["lambda_c"].to_pylist())[:, 2]).max()
        assert table.num_rows == 24
    assert pulled["about"] < 0.03 * pulled["free"]


def test_a_patch_that_cannot_turn_has_no_rotation_to_rest_in():
    with pytest.raises(ValueError, match="about_rest"):
        SampleSpec(**{**SPEC, "contact": {**SPEC["contact"], "about_rest": ["rx"]}})
