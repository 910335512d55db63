"""Parameters tracked while the robot works: tracking error under a drift, and what a bad estimate can do.

python benchmarks/adaptation.py drift MODEL [--scene SCENE] [--seconds 60]
python benchmarks/adaptation.py camera MODEL [--scene SCENE] [--seconds 60]
python benchmarks/adaptation.py seeds MODEL [--seeds 1000] [--ticks 80]

MODEL: folder of a model with Young's modulus E and Poisson's ratio nu as parameters. Commands are forces, 10 a second;
the effector's sensor has 0.1 mm of noise and comes a tick late; goals go round a closed curve in 12 s.

drift: E falls by 30 % within the time, nu differs from the model's first value from the beginning; with --scene the
plant is that robot by finite elements, in closed loop alone. Prints the root mean square of the tracking error after
the first 10 s.
camera: E is 20 % lower and nu 0.36 all the time, and the camera has moved by (3, -2, 1.5) mm and turned by 2 deg about
x and -1 deg about z since it was aligned. Prints errors in the scene's frame, and what of the camera is found.
seeds: robots that nobody expects, one a seed: E by a factor from 0.4 to 2.5, beyond the model's range where it likes,
any nu, friction of 0 to 20 %, noise up to 0.5 mm that the controller knows within a factor of 2, delays up to 3 ticks,
gross outliers, lost samples, a push that shifts the effector by up to 8 mm, sudden changes. Prints how often the
adaptive controller ends worse than the one without adaptation."""

import argparse
from contextlib import suppress
from pathlib import Path

import numpy as np

from cfem.condensed.model import under_force
from cfem.condensed.strokes import ridge_of
from cfem.control.adaptation.camera_frame import CameraFrame
from cfem.control.adaptation.controller import AdaptiveController
from cfem.control.adaptation.tracker import Tracker
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.core.errors import NumericalError
from cfem.plant.gains import Gains, integral_for
from cfem.plant.protocol import Measurement
from cfem.predict.at_parameters import AtParameters
from cfem.predict.load import load_model

RATE, NOISE = 10, 0.1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["drift", "camera", "seeds"])
    parser.add_argument("model", type=Path)
    parser.add_argument("--scene", type=Path)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--ticks", type=int, default=80)
    given = parser.parse_args()
    model = load_model(given.model)
    {"drift": drift, "camera": camera, "seeds": seeds}[given.what](given, model)


class Trial:
    """One robot model, its goals, and controllers for it."""

    def __init__(self, model, ticks: int):
        self.model, self.first = model, np.array([one.reference for one in model.parameters])
        turn = 2 * np.pi * np.arange(ticks) / (12 * RATE)
        share = np.column_stack([0.5 + 0.3 * np.cos(turn), 0.5 + 0.3 * np.sin(turn)])[:, : model.rows.n_a]
        known, near, goals = AtParameters(model, self.first), None, []
        for force in 0.6 * share * model.domain.lambda_a[1]:
            near = under_force(known, force, near or self.start(known))
            goals.append(model.rest_e + near.delta_e)
        self.goals = np.array(goals)

    def start(self, known):
        return known.at_displacement(0.2 * self.model.reach[:, 1])

    def controller(self, adapt: bool, gains: Gains | None, noise: float = NOISE, loss: float = 0.0, frame=(0.0, 0.0)):
        model, n_a = self.model, self.model.rows.n_a
        most = 2.5 * self.model.domain.lambda_a[1].max()
        course = np.column_stack([model.reach[:, 1] * -0.25, model.reach[:, 1] * 1.5])
        limits = Limits(np.array([[0.0, most]] * n_a), course)
        ridge, settings = ridge_of(1e-10, model.reach, model.length), SearchSettings(20, 1e-5, 0.25 * model.reach.max())
        pilot = Pilot(
            AtParameters(model, self.first.copy()), "force", "equilibrium", limits, np.ones(3), ridge, settings
        )
        if not adapt:
            return Controller(pilot, model.rest_e, gains)
        tracker = Tracker(model, "force", noise, loss=loss, forget=20.0, frame=frame)
        return AdaptiveController(pilot, model.rest_e, tracker, gains)

    def run(self, controller, plant, rng, noise=NOISE, delay=1, spoil=lambda tick, x: x):
        """Errors (ticks,) mm. plant(tick, u) -> x_e mm."""
        errors, samples, measured = [], [], None
        for tick, goal in enumerate(self.goals, 1):
            x = plant(tick, controller.tick(goal, measured).u)
            errors.append(np.linalg.norm(x - goal))
            seen = spoil(tick, x + noise * rng.normal(size=len(x)))
            samples.append(Measurement(seen, None, None, tick, "converged"))
            measured = samples[-1 - delay] if tick > delay else None
        return np.array(errors)


def model_plant(trial, p_of, push=lambda tick: 0.0, lost=0.0):
    """A robot of the family with parameters p_of(tick), forces less than told, and an effector that is shifted."""
    known, last = AtParameters(trial.model, trial.first.copy()), []

    def step(tick: int, u: np.ndarray) -> np.ndarray:
        known.p = p_of(tick)
        with suppress(NumericalError):  # beyond what the family knows the robot stays where it is
            near = known.at_displacement(last[0].delta_a) if last else trial.start(known)
            last[:] = [under_force(known, (1 - lost) * u, near)]
        return trial.model.rest_e + (last[0].delta_e if last else 0.0) + push(tick)

    return step


def fem_plant(scene: Path, nu: float, stiffness):
    """The robot by finite elements; its stiffness changes as identity 6 has it."""
    from cfem.core.spec import load_spec
    from cfem.plant.fem_plant import FemPlant
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh
    from cfem.robot.spec import SceneSpec

    _, mesh = load_scene_and_mesh(scene)
    plant = FemPlant(build_robot(load_spec(scene, SceneSpec, [f"material.poisson={nu}"]), mesh))
    return lambda tick, u: plant.step(u / stiffness(tick), "force").x_e


def drift(given, model) -> None:
    trial, skip = Trial(model, round(given.seconds * RATE)), 10 * RATE
    young, nu = trial.first
    loop = Gains(0.0, integral_for(np.deg2rad(60), 2))
    falls = lambda tick: 1 - 0.3 * tick / len(trial.goals)  # noqa: E731
    by = "finite elements" if given.scene else "the model itself"
    print(f"plant: {by}; {given.seconds:g} s, rms of the error after 10 s, mm; E {young:g} MPa, nu {nu:g} at first")
    for name, stiffness, real, adapt, gains in (
        ("unperturbed, open loop", lambda tick: 1.0, nu, False, None),
        ("unperturbed, closed loop", lambda tick: 1.0, nu, False, loop),
        ("drifting, open loop", falls, 0.38, False, None),
        ("drifting, closed loop", falls, 0.38, False, loop),
        ("drifting, adaptive open loop", falls, 0.38, True, None),
        ("drifting, adaptive closed loop", falls, 0.38, True, loop),
    ):
        if given.scene and gains is None:
            continue
        if given.scene:
            plant = fem_plant(given.scene, real, stiffness)
        else:
            plant = model_plant(trial, lambda tick, f=stiffness, nu=real: np.array([young * f(tick), nu]))
        controller = trial.controller(adapt, gains)
        errors = trial.run(controller, plant, np.random.default_rng(0))[skip:]
        known = f"; E {controller.tracker.p[0]:.4g} MPa, nu {controller.tracker.p[1]:.3f} at the end" if adapt else ""
        print(f"{name}: {np.sqrt(np.mean(errors**2)):.3f}, largest {errors.max():.3f}{known}", flush=True)


def camera(given, model) -> None:
    trial, skip, loop = (
        Trial(model, round(given.seconds * RATE)),
        10 * RATE,
        Gains(0.0, integral_for(np.deg2rad(60), 2)),
    )
    young, nu = trial.first
    moved = np.array([3.0, -2.0, 1.5, *np.deg2rad([2.0, 0.0, -1.0])])
    eye = CameraFrame.of(model.rows, model.rest_e)
    seen = lambda tick, x: model.rest_e + eye.shown(x - model.rest_e, moved)  # noqa: E731
    print(f"camera moved by {moved[:3].tolist()} mm and turned by {np.rad2deg(moved[3:]).round(2).tolist()} deg; "
          f"{given.seconds:g} s, rms of the error after 10 s, mm")  # fmt: skip
    for name, spoil, E, real, adapt, frame in (
        ("unperturbed, closed loop", lambda tick, x: x, 1.0, nu, False, (0.0, 0.0)),
        ("camera moved, closed loop", seen, 1.0, nu, False, (0.0, 0.0)),
        ("camera moved and softer, closed loop", seen, 0.8, 0.36, False, (0.0, 0.0)),
        ("camera moved and softer, adaptive", seen, 0.8, 0.36, True, (0.0, 0.0)),
        ("camera moved and softer, adaptive, camera tracked", seen, 0.8, 0.36, True, (5.0, np.deg2rad(3.0))),
    ):
        if given.scene:
            plant = fem_plant(given.scene, real, lambda tick, E=E: E)
        else:
            plant = model_plant(trial, lambda tick, E=E, real=real: np.array([young * E, real]))
        controller = trial.controller(adapt, loop, frame=frame)
        errors = trial.run(controller, plant, np.random.default_rng(0), spoil=spoil)[skip:]
        found = ""
        if adapt:
            f, p = controller.tracker.used_f, controller.tracker.p
            found = (f"; E {p[0]:.4g} MPa, nu {p[1]:.3f}, camera {f[:3].round(2).tolist()} mm, "
                     f"{np.rad2deg(f[3:]).round(2).tolist()} deg")  # fmt: skip
        print(f"{name}: {np.sqrt(np.mean(errors**2)):.3f}, largest {errors.max():.3f}{found}", flush=True)


def seeds(given, model) -> None:
    trial, loop, ends = Trial(model, given.ticks), Gains(0.0, integral_for(np.deg2rad(60), 4)), []
    for seed in range(given.seeds):
        rng = np.random.default_rng(seed)
        wild = strange(rng, trial, given.ticks)
        both = []
        for adapt in (False, True):
            controller = trial.controller(adapt, loop, wild["believed"], wild["loss"])
            plant = model_plant(trial, wild["p"], wild["push"], wild["lost"])
            spoil = spoiler(np.random.default_rng(seed), wild)
            errors = trial.run(controller, plant, np.random.default_rng(seed), wild["noise"], wild["delay"], spoil)
            both.append(errors)
        half = given.ticks // 2
        ends.append([*(np.sqrt(np.mean(one[half:] ** 2)) for one in both), *(one[half:].max() for one in both)])
        if (seed + 1) % 100 == 0:
            told(np.array(ends), given.ticks)
    if given.seeds % 100:
        told(np.array(ends), given.ticks)


def told(ends: np.ndarray, ticks: int) -> None:
    plain, adaptive, plain_most, adaptive_most = ends.T
    worse = adaptive > 1.5 * plain + 1.0
    print(f"{len(ends)} seeds, {ticks} ticks; rms error of the second half, mm")
    print(f"without adaptation: median {np.median(plain):.2f}, largest {plain.max():.2f}")
    print(f"with adaptation: median {np.median(adaptive):.2f}, largest {adaptive.max():.2f}")
    print(f"adaptation ends worse than 1.5 times plus 1 mm: {worse.sum()}, seeds {np.flatnonzero(worse).tolist()}")
    print(f"largest single error: {plain_most.max():.1f} without, {adaptive_most.max():.1f} with; not finite: "
          f"{int((~np.isfinite(adaptive)).sum())}", flush=True)  # fmt: skip


def strange(rng, trial, ticks: int) -> dict:
    """A robot that nobody expects."""
    low, high = np.array([[one.low, one.high] for one in trial.model.parameters]).T
    p = rng.uniform(low, high)
    p[0] = trial.first[0] * np.exp(rng.uniform(np.log(0.4), np.log(2.5)))
    after, when = p.copy(), int(rng.integers(ticks // 4, ticks))
    after[0] *= np.exp(rng.uniform(-0.7, 0.7)) if rng.random() < 0.3 else 1.0
    push = rng.normal(size=3)
    push *= rng.uniform(0, 8) / np.linalg.norm(push) if rng.random() < 0.3 else 0.0
    start = int(rng.integers(1, ticks))
    return {
        "p": lambda tick: after if tick >= when else p,
        "push": lambda tick: push if tick >= start else 0.0 * push,
        "lost": rng.uniform(0, 0.2) if rng.random() < 0.5 else 0.0,
        "noise": (noise := rng.uniform(0.02, 0.5)),
        "believed": noise * np.exp(rng.uniform(-0.7, 0.7)),
        "loss": 0.2 if rng.random() < 0.5 else 0.0,
        "delay": int(rng.integers(0, 4)),
        "outliers": rng.uniform(0, 0.2) if rng.random() < 0.3 else 0.0,
        "missing": rng.uniform(0, 0.3) if rng.random() < 0.3 else 0.0,
    }


def spoiler(rng, wild):
    def spoil(tick: int, x: np.ndarray) -> np.ndarray:
        chance = rng.random(2)
        if chance[0] < wild["missing"]:
            return np.full_like(x, np.nan)
        return x + 30.0 * rng.normal(size=len(x)) if chance[1] < wild["outliers"] else x

    return spoil


if __name__ == "__main__":
    main()
