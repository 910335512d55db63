"""Does the closed loop converge however wrong the stiffness of the pneumatic trunk is?

python benchmarks/stiff_flop_stability.py [--seeds 1000] [--plant serial|fem] [--wrong 0.5] [--alike] [--noise 0.01]
[--damping 1e-4] [--regularisation 1e-5] [--margin 80]

Every seed draws a stiffness for each module, 1 +- wrong times the model's, each for itself or both alike, and a goal:
where pressures between 0 and 110 kPa take the model. Sensors are noisy and one tick late, pressures are rounded to
0.2 kPa. The controller's model is of the whole trunk (models/stiff-flop/spectral-export); the robot is modules in a row
(models/stiff-flop/serial-export), another model, or the finite-element rod. A run of 135 ticks converges where its last
45 all lie within 0.5 mm of the goal; of one that does not, the robot's own model says how near the goal pressures up to
200 kPa can take it."""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.run import Pace, run_closed_loop
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import Iterate, SearchSettings, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.plant.gains import Gains, integral_for
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import load_model

ROOT = Path(__file__).parents[1]
YOUNG, SOFTER = (150.0, 90.0), np.array([1.0, 5 / 3])
LARGEST, RADIUS, TICKS, HELD = 0.2, 0.5, 135, 45  # MPa, mm


def serial(stiffness: np.ndarray):
    model = load_model(ROOT / "models/stiff-flop/serial-export")
    model._softer = SOFTER / stiffness
    return model


def fem(stiffness: np.ndarray):
    from cfem.core.spec import load_spec
    from cfem.plant.fem_plant import FemPlant
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh
    from cfem.robot.spec import SceneSpec

    scene = ROOT / "pipelines/stiff-flop/scene.yaml"
    _, mesh = load_scene_and_mesh(scene)
    base, top = stiffness * YOUNG
    overrides = [f"material.young={base:.17g} kPa", f"materials.0.material.young={top:.17g} kPa"]
    return FemPlant(build_robot(load_spec(scene, SceneSpec, overrides), mesh))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--plant", choices=["serial", "fem"], default="serial")
    parser.add_argument("--wrong", type=float, default=0.5)
    parser.add_argument("--alike", action="store_true")
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--damping", type=float, default=1e-4)
    parser.add_argument("--regularisation", type=float, default=1e-5)
    parser.add_argument("--margin", type=float, default=80.0)
    arguments = parser.parse_args()
    model = load_model(ROOT / "models/stiff-flop/spectral-export")
    low, high = np.stack([model.reach, model.domain.delta_a.T], axis=-1).swapaxes(0, 1)
    limits = Limits(np.tile([0.0, LARGEST], (6, 1)), np.column_stack([low.min(axis=-1), high.max(axis=-1)]))
    ridge = ridge_of(arguments.regularisation, model.reach, model.length)
    damping = ridge_of(arguments.damping, model.reach, model.length)
    pilot = Pilot(
        model, "force", "equilibrium", limits, np.ones(3), ridge, SearchSettings(1, 1e-5, 5.0), damping=damping
    )
    gains = Gains(0.0, integral_for(np.deg2rad(arguments.margin), 1))
    begin, ticks, last, lost = time.process_time(), [], [], []
    for seed in range(arguments.seeds):
        random = np.random.default_rng(seed)
        stiffness = random.uniform(1 - arguments.wrong, 1 + arguments.wrong, 2)
        stiffness = stiffness[[0, 0]] if arguments.alike else stiffness
        goal = model.rest_e + model.at_force(random.uniform(0, 0.11, 6)).delta_e
        robot = {"serial": serial, "fem": fem}[arguments.plant](stiffness)
        bare = robot if arguments.plant == "fem" else ModelPlant(robot, model.rest_e)
        plant = ImperfectPlant(bare, Imperfection(noise=arguments.noise, delay=1, quantum=2e-4), seed)
        pace = Pace(RADIUS, HELD, ticks_a_goal=TICKS)
        errors = np.array([one.error for one in run_closed_loop(goal[None], pilot, plant, model.rest_e, pace, gains)])
        outside = np.flatnonzero(~(errors <= RADIUS))
        if len(outside) and outside[-1] >= TICKS - HELD:
            free = replace(limits, delta_a=np.tile([-np.inf, np.inf], (6, 1)))
            aim = Aim(goal - model.rest_e, np.ones(3), ridge)
            best = search_goal(
                robot, aim, free, Iterate.at(robot.at_displacement(np.zeros(6))), SearchSettings(60, 1e-4, 5.0)
            )
            off = {"farthest, mm": round(float(errors[-HELD:].max()), 2), "in reach to, mm": round(best.distance, 3)}
            lost.append({"seed": seed, "stiffness": stiffness.round(2).tolist(), **off})
        else:
            ticks.append(int(outside[-1]) + 2 if len(outside) else 1)
            last.append(errors[-HELD:].max())
    print(
        json.dumps(
            {
                "runs": arguments.seeds,
                "converged": len(ticks),
                "ticks": {"median": float(np.median(ticks)), "p99": float(np.percentile(ticks, 99)), "max": max(ticks)},
                "farthest of the last ticks, mm": round(float(max(last)), 3),
                "in reach and did not": sum(one["in reach to, mm"] <= RADIUS for one in lost),
                "those that did not": lost[:8],
                "cpu_seconds": round(time.process_time() - begin, 1),
            },
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
