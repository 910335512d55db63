"""Predictive control in C against that of Python, tick by tick, and what it says where it has no command."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from export.embedded import needs_compiler
from export.moving import both, goals, model, robot, spec
from support.bad_samples import KINDS, spoiling
from support.fast_cases import fast_are

from cfem.core.errors import InputError, SpecError
from cfem.export.firmware.mpc import mpc_constants, write_c_mpc
from cfem.motion.altered import Altered
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.moving_plant import MovingModelPlant

LIMITED, SOFTENED, HELD, BAD_INPUT, NO_QP, REJECTED, RESTARTED = 1, 2, 16, 32, 128, 256, 512
FAR = 2048
TICKS, HORIZON, NOISE = 24, 8, 0.1  # mm
CASES = {
    "forces": spec(),
    "displacements": spec("displacement"),
    "bounded": spec(mpc={"moves": 4, "effort": 1e-6}, largest_force="7 N", force_rate="0.3 N"),
    "bounded displacements": spec("displacement", rate="0.1 mm", largest_force="8 N"),
    "planes that cannot be kept": spec(
        mpc={"obstacles": [{"point": {"mm": [0, 50, 0]}, "normal": [0, -1, 0]}]}, force_rate="0.1 N"
    ),
    "without sensors": spec(mpc={"sensor": False}),
}
pytestmark = needs_compiler


def robot_of(chosen, u, seed=2):
    """Not the model's, at rest under u (2,): samples come a tick late, with noise."""
    body = MovingModelPlant(Altered(model(), 1.1, 1.2), 1 / 50, 2)
    body.settle(u, chosen.controller.command)
    return ImperfectPlant(body, Imperfection(NOISE, 1.0, 1), seed=seed)


def followed(chosen, folder, ticks=TICKS, spoilt=lambda tick, sample: sample):
    """Commands (ticks, 2) of C and of Python to the same robot, and what they say."""
    compiled, python = both(folder, chosen)
    there, plant, measured, found = goals(ticks + HORIZON), robot_of(chosen, python.belief.u), None, []
    for k in range(ticks):
        ahead = there[k : k + HORIZON]
        if measured is not None:
            measured = replace(measured, x_e=spoilt(k, measured.x_e))
        said = compiled.step(ahead, *(() if measured is None else (measured.x_e, measured.t)))
        told = python.tick(ahead[0], measured, ahead)
        found.append((said, told))
        measured = plant.step(told.u, chosen.controller.command)
    return found


@pytest.mark.parametrize("case", fast_are({"bounded displacements", "planes that cannot be kept"}, CASES), ids=str)
def test_commands_are_those_of_python(tmp_path, case):
    found = followed(CASES[case], tmp_path)
    u, wanted = (np.array([each.u for each in one]) for one in zip(*found, strict=True))
    delta, there = (np.array([each.delta_a for each in one]) for one in zip(*found, strict=True))
    assert all(told.status == "converged" for _, told in found)
    np.testing.assert_allclose(u, wanted, atol=1e-8 * np.abs(wanted).max())
    np.testing.assert_allclose(delta, there, atol=1e-8 * np.abs(there).max())
    status = np.array([said.status for said, _ in found])
    assert not (status & HELD).any()
    np.testing.assert_array_equal((status & SOFTENED) > 0, [told.softened for _, told in found])
    assert ((status & LIMITED) > 0).mean() > 0.5 or "bounded" not in case
    assert (status & SOFTENED).any() == ("cannot" in case)
    assert np.ptp(wanted, axis=0).min() > 0.02 * np.abs(wanted).max()


def elsewhere(tick, sample):
    return sample + (np.array([9.0, -6.0, 4.0]) if tick >= 20 else 0.0)


@pytest.fixture(scope="module", params=fast_are({"displacement"}, ["force", "displacement"]))
def plain(request, tmp_path_factory):
    """A spec, and a folder that is compiled once."""
    return spec(request.param), tmp_path_factory.mktemp(request.param)


@pytest.mark.parametrize("case", fast_are({"burst", "pushed"}, [*KINDS, "pushed"]))
def test_bad_samples_are_rejected_as_in_python(plain, case):
    chosen, folder = plain
    spoilt = elsewhere if case == "pushed" else spoiling(case, np.random.default_rng(3), 40)
    found = followed(chosen, folder, 48, lambda tick, x: spoilt(tick, x) if tick < 40 else x)
    u, wanted = (np.array([each.u for each in one]) for one in zip(*found, strict=True))
    np.testing.assert_allclose(u, wanted, atol=1e-7 * np.abs(wanted).max())
    status = np.array([said.status for said, _ in found])
    assert not (status & HELD).any()
    np.testing.assert_array_equal((status & REJECTED) > 0, [told.rejected for _, told in found])
    np.testing.assert_array_equal((status & RESTARTED) > 0, [told.restarted for _, told in found])
    assert (status & REJECTED).any() == (case != "not finite") or case == "2 %"
    assert (status & RESTARTED).any() == (case == "pushed")


BEFORE, SPOILT, AFTER = 30, 60, 30


def left_after_bad_samples(chosen, folder, count):
    """(count,) mm: from the 20th to the 30th clean tick after bad samples, by how much the tip is farther from its
    goals than in a run without, on average; held nowhere, and commands are within their bounds throughout."""
    compiled, python = both(folder, chosen)
    ticks = BEFORE + SPOILT + AFTER
    there, farther = goals(ticks + HORIZON), []
    low, high = mpc_constants(chosen, *robot())[2]["command"].T

    def missed(seed, spoilt):
        compiled.reset()
        plant, measured, errors = robot_of(chosen, python.belief.u, seed), None, []
        for k in range(ticks):
            sample = ()
            if measured is not None:
                bad = BEFORE <= k < BEFORE + SPOILT
                sample = (spoilt(k - BEFORE, measured.x_e) if bad else measured.x_e), measured.t
            said = compiled.step(there[k : k + HORIZON], *sample)
            assert (said.u >= low).all() and (said.u <= high).all()
            assert not said.status & HELD
            measured = plant.step(said.u, chosen.controller.command)
            errors.append(np.linalg.norm(plant.actual.x_e - there[k]))
        return np.array(errors[-AFTER + 20 :])

    for seed in range(count):
        kind = KINDS[seed % len(KINDS)]
        clean, bad = missed(seed, lambda k, x: x), missed(seed, spoiling(kind, np.random.default_rng(seed), SPOILT))
        farther.append((bad - clean).mean())
    return np.array(farther)


def test_it_recovers_from_bad_samples_within_20_ticks(plain):
    assert left_after_bad_samples(*plain, len(KINDS)).max() < np.sqrt(3) * NOISE  # of a sample


@pytest.mark.slow
def test_a_thousand_runs_recover_from_bad_samples_within_20_ticks(plain):
    assert left_after_bad_samples(*plain, 1000).max() < np.sqrt(3) * NOISE


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("forces")


def test_without_a_command_the_plan_goes_on(folder):
    compiled, python = both(folder, CASES["forces"])
    there = goals(20)
    for k in range(4):
        compiled.step(there[k:])
        python.tick(there[k], None, there[k:])
    told = python.tick(np.full(3, np.nan))
    said = compiled.step(np.full(3, np.nan))
    assert said.status == HELD | BAD_INPUT
    np.testing.assert_allclose(said.u, told.u, rtol=1e-10)
    for factor in (1e3, 1e-3):  # micrometres, metres
        far = compiled.step(factor * there[5:])
        assert far.status == HELD | BAD_INPUT | FAR and np.isfinite(far.u).all()
    late = compiled.step(there[5:], there[0], sampled=9)  # of a tick that has not been
    assert late.status == HELD | BAD_INPUT and np.isfinite(late.u).all()
    assert compiled.step(there[6:], there[5], sampled=5).status & HELD == 0


def test_bounds_that_exclude_each_other_have_no_program(tmp_path):
    """Force and rate: the robot stands beyond the one, and the other keeps it there."""
    chosen = spec(largest_force="5 N", force_rate="0.1 N")
    compiled, python = both(tmp_path, chosen)
    said, told = compiled.step(goals(8)), python.tick(goals(1)[0], None, goals(8))
    assert said.status == HELD | NO_QP and told.status != "converged"
    np.testing.assert_allclose(said.u, told.u, rtol=1e-12)


def test_a_sample_that_is_not_finite_is_not_heard(folder):
    compiled, _ = both(folder, CASES["forces"])
    there = goals(20)
    for k in range(3):
        compiled.step(there[k:], there[k], k)
    said = compiled.step(there[3:], np.full(3, np.nan), 3)
    assert said.status & HELD == 0 and np.isfinite(said.u).all()


def test_samples_that_never_come_are_no_trouble(folder):
    compiled, python = both(folder, CASES["forces"])
    there = goals(20)
    for k in range(12):  # more than samples may be late
        said, told = compiled.step(there[k:]), python.tick(there[k], None, there[k:])
        assert said.status & HELD == 0
        np.testing.assert_allclose(said.u, told.u, rtol=1e-7)


def test_what_it_cannot_be_is_said(tmp_path):
    meta, arrays, moving = robot()
    with pytest.raises(SpecError, match="in double or in single precision"):
        write_c_mpc(tmp_path, spec().model_copy(update={"scalar": "float"}), meta, arrays, moving)
    flat = {**meta, "form": "force"}
    with pytest.raises(InputError, match="only energy models"):
        write_c_mpc(tmp_path, spec(), flat, arrays, moving)


def test_the_example_follows_its_curve(folder):
    """The condensed robot as plant, noise and a late sample: nearer than the static inverse, which has neither."""
    both(folder, CASES["forces"])
    for program in (["make", "-s", "-C", str(folder), "mpc", "CFLAGS=-O1"], [str(folder / "mpc_loop"), "0.6"]):
        done = subprocess.run(program, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    mean = {said[:14].strip(): float(said.split("mean ")[1].split()[0]) for said in done.stdout.splitlines()[:2]}
    assert mean["predictive"] < 0.7 * mean["static inverse"]
    assert ", 0 without a command" in done.stdout and "ticks, state" in done.stdout
    assert subprocess.run([str(folder / "mpc_loop"), "-1"], capture_output=True).returncode == 2
