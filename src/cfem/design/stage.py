"""`cfem optimize-design`: from what is asked of a design to the designs that do it best."""

import time
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import SpecError
from cfem.core.files import write_json, write_whole
from cfem.core.spec import load_spec
from cfem.core.stage import Options, Stage, run_stage
from cfem.design.spec import ConstraintFunction, DesignSpec, DexteritySpec, FunctionSpec

RESULT, GRID, FRONT = "design.json", "grid.parquet", "front.parquet"
_PATHS = ("model", "scene", "mesh")


def run(spec_path: Path, overrides: Iterable[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The manifest; results: the best design by every objective and blend, the front, the task, each verified."""
    spec = load_spec(spec_path, DesignSpec, overrides)
    base = spec_path.parent
    paths = {name: base / getattr(spec, name) for name in _PATHS if getattr(spec, name) is not None}
    if spec.verify == "no":
        paths.pop("mesh", None)
    stage = Stage(
        name="optimize-design",
        version=1,
        spec=spec,
        inputs=paths | _sources(spec, base),
        out=out or base / spec.out,
        paths=(*_PATHS, "out"),
    )
    return run_stage(stage, partial(_work, spec=spec, paths=paths, base=base), options)


def _sources(spec: DesignSpec, base: Path) -> dict[str, Path]:
    """The files of the user's own functions: what they say decides the output."""
    named = [one.function for one in spec.objectives.values() if isinstance(one, FunctionSpec)]
    named += [one.function for one in spec.constraints.values() if isinstance(one, ConstraintFunction)]
    files = {one.rpartition(":")[0] for one in named}
    return {f"function {file}": base / file for file in sorted(files) if file.endswith(".py")}


def _work(folder: Path, spec: DesignSpec, paths: dict[str, Path], base: Path) -> dict[str, Any]:
    from cfem.parametric.load import finite_elements, learned

    family = learned(paths["model"], paths.get("scene"))
    exact = finite_elements(paths["scene"], paths["mesh"], family.parameters) if spec.verify != "no" else None
    results: dict[str, Any] = {"headline": []}
    asked = _asked(spec, family.rows) if spec.task else None
    if spec.objectives:
        results |= _search(folder, spec, family, exact, paths, base, results["headline"])
    if spec.task:
        results["task"] = _task(spec, asked, family, exact, results["headline"])
    write_json(folder / RESULT, {key: value for key, value in results.items() if key != "headline"})
    return results


def _vary(spec: DesignSpec, parameters: Any) -> tuple[list[int], np.ndarray]:
    """Numbers of the parameters that vary, values (n_p,) of all."""
    from cfem.parametric.given import demand_known, vector

    names = [one.name for one in parameters]
    wanted = spec.vary if spec.vary is not None else [name for name in names if name not in spec.fixed]
    demand_known(parameters, wanted, "vary")
    p0 = vector(parameters, spec.fixed, "fixed")
    both = sorted(set(wanted) & set(spec.fixed))
    if both or not wanted:
        raise SpecError(f"{both} both vary and are fixed" if both else "nothing is left to vary", where="vary")
    return [names.index(name) for name in wanted], p0


def problem_of(spec: DesignSpec, family: Any, scene: Path | None, base: Path) -> tuple[Any, Any]:
    """The problem, and the volume where a constraint speaks of it."""
    from cfem.design.problem import Problem

    free, p0 = _vary(spec, family.parameters)
    volume = _volume(spec, family, scene)
    kind, u = (
        ("force", spec.actuation.force)
        if spec.actuation.displacement is None
        else ("displacement", spec.actuation.displacement)
    )
    if len(u) != family.rows.n_a:
        raise SpecError(f"{len(u)} numbers for {family.rows.n_a} actuators", where=f"actuation.{kind}")
    objectives = {name: _objective(name, one, family.rows, base) for name, one in spec.objectives.items()}
    constraints = {name: _constraint(name, one, family, volume, base) for name, one in spec.constraints.items()}
    if spec.largest_force is not None:
        largest = spec.largest_force
        for i, name in enumerate(family.rows.actuators):
            constraints[f"force of {name}"] = lambda states, i=i: largest - np.abs(states.lam[:, i])
    return Problem(family, kind, np.asarray(u, float), free, p0, objectives, constraints), volume


def _volume(spec: DesignSpec, family: Any, scene: Path | None) -> Any:
    from cfem.design.expression import names_in

    texts = [one for one in spec.constraints.values() if isinstance(one, str)]
    if not any("volume" in names_in(text) for text in texts):
        return None
    if scene is None:
        raise SpecError("a constraint on the volume needs the scene", where="scene")
    from cfem.design.volume import Volume
    from cfem.robot.spec import SceneSpec

    return Volume(load_spec(scene, SceneSpec), family.parameters)


def _objective(name: str, one: Any, rows: Any, base: Path) -> Any:
    from cfem.design.objectives import Dexterity, OwnFunction, Strength, load_function, position_rows

    where = f"objectives.{name}"
    if isinstance(one, FunctionSpec):
        sign = 1.0 if one.sense == "minimise" else -1.0
        return OwnFunction(where, load_function(one.function, base, where), sign)
    which, along = position_rows(rows, one.effector, where), "xyz".index(one.axis)
    rest = None if one.rest is None else np.asarray(one.rest)
    if isinstance(one, DexteritySpec):
        return Dexterity(which, along, one.angle, rest)
    return Strength(which, along, one.largest, rest)


def _constraint(name: str, one: Any, family: Any, volume: Any, base: Path) -> Any:
    from cfem.design.expression import inequality
    from cfem.design.objectives import OwnFunction, load_function

    where = f"constraints.{name}"
    parameters = [parameter.name for parameter in family.parameters]
    if isinstance(one, str):
        slack = inequality(one, [*parameters, *(["volume"] if volume else [])], where)

        def holds(states: Any) -> np.ndarray:
            values = dict(zip(parameters, states.p.T, strict=True))
            return np.broadcast_to(slack(values | ({"volume": volume(states.p)} if volume else {})), (len(states),))

        return holds
    own = OwnFunction(where, load_function(one.function, base, where))

    def bounded(states: Any) -> np.ndarray:
        found = own(states)
        slacks = [found - one.at_least] if one.at_least is not None else []
        slacks += [one.at_most - found] if one.at_most is not None else []
        return np.min(slacks, axis=0)

    return bounded


def _search(
    folder: Path, spec: DesignSpec, family: Any, exact: Any, paths: dict[str, Path], base: Path, headline: list[str]
) -> dict[str, Any]:
    from cfem.design.front import best_of_each, pareto_front
    from cfem.design.search import Scalar, best, evaluate_grid

    problem, volume = problem_of(spec, family, paths.get("scene"), base)
    n = len(problem.free)
    shape = [spec.grid] * n if isinstance(spec.grid, int) else list(spec.grid)
    if len(shape) != n:
        raise SpecError(f"{len(shape)} numbers of points for {n} parameters that vary", where="grid")
    seconds = {}
    if volume:
        headline.append(f"volume: polynomial through CAD models, off by {volume.error:.1e} mm^3 at others")
    begin = time.process_time()
    grid = evaluate_grid(problem, shape)
    seconds["grid"], begin = time.process_time() - begin, time.process_time()
    designs = dict(zip(problem.names, best_of_each(problem, grid, spec.starts), strict=True))
    for name, weights in spec.blends.items():
        row = Scalar.weighted(np.array([weights.get(one, 0.0) for one in problem.names]))
        designs[name] = best(problem, grid, row, spec.starts)
    seconds["search"], begin = time.process_time() - begin, time.process_time()
    front = None
    if spec.front:
        ends = [designs[name] for name in spec.front.of]
        front = pareto_front(problem, grid, spec.front.of, spec.front.points, ends)
        seconds["front"] = time.process_time() - begin
        designs |= {f"front {name}": front.designs[place] for name, place in front.corners.items()}
    checked = _verify(problem, exact, designs, front, spec)
    results: dict[str, Any] = {
        "grid": {"designs": len(grid.z), "feasible": int(grid.scores.feasible.sum())},
        "spread": {
            name: [float(low), float(low + width)]
            for name, low, width in zip(problem.names, grid.low, grid.width, strict=True)
        },
        "designs": {},
        "slopes_checked": _slopes_checked(problem),
        "seconds": seconds,
        "evaluations": problem.evaluations,
        "signs": {name: getattr(one, "sign", 1.0) for name, one in problem.objectives.items()},
    }
    for name, design in designs.items():
        results["designs"][name] = entry = _entry(
            problem, family, grid, design, checked.get(design.z.tobytes()), volume
        )
        headline.append(_line(name, entry, spec))
    if front:
        results["front"] = {
            "of": front.names,
            "designs": len(front.designs),
            "corners": front.corners,
            "hypervolume": front.volume,
            "grid_hypervolume": front.grid_volume,
            "beaten_by_grid": front.beaten,
        }
        headline.append(
            f"front: {len(front.designs)} designs in {seconds['front']:.2f} s of CPU time"
            + (
                ""
                if front.volume is None
                else f", hypervolume {front.volume:.4f}, of the grid's {front.grid_volume:.4f}"
            )
            + f"; {front.beaten} points of the grid beat one of it"
        )
        _table(
            folder / FRONT,
            problem,
            np.array([one.z for one in front.designs]),
            np.array([one.objectives for one in front.designs]),
            np.array([one.constraints for one in front.designs]),
        )
    if volume:
        results["volume_error"] = volume.error
    _table(folder / GRID, problem, grid.z, *grid.scores)
    headline.append(
        f"{len(grid.z)} designs in {1e3 * seconds['grid']:.0f} ms of CPU time; slopes agree with differences of "
        f"second order to {results['slopes_checked']:.0e}"
    )
    if spec.cad:
        _write_cad(folder, {name: problem.p(one.z) for name, one in designs.items()}, family, paths)
    if spec.figures:
        _draw(folder, problem, grid, designs, front, checked, results)
    return results


def _write_cad(folder: Path, designs: dict[str, np.ndarray], family: Any, paths: dict[str, Path]) -> None:
    """`<name>.step` and `<name>.stl` of each design."""
    from cfem.robot.meshing import CATALOGUE, write_cad
    from cfem.robot.spec import SceneSpec
    from cfem.sample.parameters import with_values

    if "scene" not in paths:
        raise SpecError("the shapes of designs need the scene", where="cad", do="name it under `scene`")
    scene = load_spec(paths["scene"], SceneSpec)
    if type(scene.geometry) not in CATALOGUE:
        raise SpecError(f"geometry of kind {scene.geometry.kind} has no designs", where="cad")
    for name, p in designs.items():
        geometry = with_values(scene, [one.key for one in family.parameters], p).geometry
        files = [folder / f"{name.replace(' ', '-')}{suffix}" for suffix in (".step", ".stl")]
        write_cad(CATALOGUE[type(geometry)](geometry), files)


def _verify(problem: Any, exact: Any, designs: dict, front: Any, spec: DesignSpec) -> dict[bytes, Any]:
    """z -> (objectives, constraints, mm between tips) by finite elements."""
    from cfem.design.verify import verify

    if exact is None:
        return {}
    wanted = [one.z for one in designs.values()]
    if front and spec.verify == "fe-front":
        wanted += [one.z for one in front.designs]
    unique = list({z.tobytes(): z for z in wanted}.values())
    found = verify(problem, exact, unique)
    rows = zip(found.fe.objectives, found.fe.constraints, found.distance, strict=True)
    return dict(zip([z.tobytes() for z in unique], rows, strict=True))


def _entry(problem: Any, family: Any, grid: Any, design: Any, checked: Any, volume: Any) -> dict[str, Any]:
    p = problem.p(design.z)
    states = family.at(problem.kind, problem.u, p[None])
    varied = [problem.family.parameters[i] for i in problem.free]
    entry = {
        "p": dict(zip([one.name for one in family.parameters], p, strict=True)),
        "overrides": [
            f"{one.key}={value:.10g}" + ("" if one.unit == "1" else f" {one.unit}")
            for one, value in zip(family.parameters, p, strict=True)
        ],
        "at_ends_of_range": [one.name for one, z in zip(varied, design.z, strict=True) if min(z, 1 - z) < 1e-6],
        "objectives": dict(zip(problem.names, design.objectives, strict=True)),
        "constraints": dict(zip(problem.constraints, design.constraints, strict=True)),
        "effector": states.x_e[0],
        "actuators": {"displacement": states.delta_a[0], "force": states.lam[0]},
        "outside": bool(family.outside(states)),
        "search": f"{design.iterations} iterations: {design.message}",
    }
    if volume:
        entry["volume"] = {"fitted": float(volume(p[None])[0]), "cad": volume.exact(p)}
    if checked is not None:
        objectives, constraints, distance = checked
        entry["fe"] = {
            "objectives": dict(zip(problem.names, objectives, strict=True)),
            "constraints": dict(zip(problem.constraints, constraints, strict=True)),
            "gap": dict(zip(problem.names, design.objectives - objectives, strict=True)),
            "gap_share_of_spread": dict(
                zip(problem.names, np.abs(design.objectives - objectives) / grid.width, strict=True)
            ),
            "effector_distance": float(distance),
        }
    return entry


def _line(name: str, entry: dict[str, Any], spec: DesignSpec) -> str:
    values = ", ".join(f"{key} {value:.4g}" for key, value in entry["p"].items())
    shown = [name] if name in entry["objectives"] else list(entry["objectives"])
    scores = ", ".join(f"{key} {entry['objectives'][key]:.5g}" for key in shown)
    line = f"{name}: {values}: {scores}"
    if "fe" in entry:
        worst = max(entry["fe"]["gap_share_of_spread"][key] for key in shown)
        line += (
            f"; finite elements {', '.join(format(entry['fe']['objectives'][key], '.5g') for key in shown)} "
            f"(off by {100 * worst:.2g} % of the spread, tip {entry['fe']['effector_distance']:.1e} mm)"
        )
    return line + ("; outside what the model was trained on" if entry["outside"] else "")


def _slopes_checked(problem: Any) -> float:
    """Largest difference between the slopes that the search uses and those by plain central differences, relative to
    each row's largest, at the middle of the ranges."""
    from cfem.parametric.differences import Stencil

    z = np.full(len(problem.free), 0.45)
    mine, plain = problem.with_slopes(z)[1], problem.with_slopes(z, Stencil(2, 1e-4))[1]
    size = np.abs(mine).max(axis=1, keepdims=True)
    return float((np.abs(mine - plain) / np.where(size > 0, size, 1.0)).max(initial=0.0))


def _table(path: Path, problem: Any, z: np.ndarray, objectives: np.ndarray, constraints: np.ndarray) -> None:
    """A row a design: parameters, objectives as they are minimised, slacks of the constraints."""
    import json

    import pyarrow as pa

    from cfem.dataset.writer import write_table

    p = problem.p(z)
    columns = {one.name: pa.array(p[:, i]) for i, one in enumerate(problem.family.parameters)}
    columns |= {f"objective.{name}": pa.array(objectives[:, i]) for i, name in enumerate(problem.names)}
    columns |= {f"slack.{name}": pa.array(constraints[:, i]) for i, name in enumerate(problem.constraints)}
    meta = {
        "units": {one.name: one.unit for one in problem.family.parameters},
        "kind": problem.kind,
        "u": problem.u.tolist(),
    }
    write_table(path, pa.table(columns).replace_schema_metadata({"cfem": json.dumps(meta)}))


def _asked(spec: DesignSpec, rows: Any) -> Any:
    from cfem.design.task import Task

    task = spec.task
    goals = np.asarray(task.goals)
    weights = np.ones(rows.n_e) if task.weights is None else np.array(task.weights)
    force = np.zeros(rows.n_e) if task.force is None else np.asarray(task.force, float)
    for where, given in (("goals", goals[0]), ("weights", weights), ("force", force)):
        if len(given) != rows.n_e:
            raise SpecError(f"{len(given)} numbers for {rows.n_e} effector rows", where=f"task.{where}")
    return Task(goals, task.relative_to == "rest", weights, np.tile(force, (len(goals), 1)))


def _task(spec: DesignSpec, asked: Any, family: Any, exact: Any, headline: list[str]) -> dict[str, Any]:
    from cfem.design.task import serve

    free, p0 = _vary(spec, family.parameters)
    goals, force, matter = asked.goals, asked.force[0], asked.weights > 0
    begin = time.process_time()
    before = serve(family, asked, [], p0, spec.task.starts)
    found = serve(family, asked, free, p0, spec.task.starts)
    seconds = time.process_time() - begin
    results: dict[str, Any] = {"seconds": seconds, "evaluations": before.evaluations + found.evaluations}
    for name, one in (("reference", before), ("found", found)):
        results[name] = {
            "p": dict(zip([parameter.name for parameter in family.parameters], one.p, strict=True)),
            "delta_a": one.u,
            "lambda_a": one.states.lam,
            "distance": one.distance,
            "pushing_states": int((one.states.lam < -1e-9).any(axis=1).sum()),
            "outside": family.outside(one.states),
        }
    rms = [float(np.sqrt((one.distance**2).mean())) for one in (before, found)]
    values = ", ".join(f"{key} {value:.4g}" for key, value in results["found"]["p"].items())
    line = f"task: {values} reaches {len(goals)} goals to {rms[1]:.3g} mm (rms), the reference to {rms[0]:.3g} mm"
    if exact:
        # the force as a dead load, not to first order
        there = exact.at("displacement", found.u, np.tile(found.p, (len(goals), 1)), force if force.any() else None)
        place = there.delta_e if asked.from_rest else there.x_e
        apart = np.linalg.norm((place - goals)[:, matter], axis=1)
        results["found"]["fe_distance"] = apart
        line += f", by finite elements {float(np.sqrt((apart**2).mean())):.3g} mm"
    headline.append(line)
    return results


def _draw(folder: Path, problem: Any, grid: Any, designs: dict, front: Any, checked: dict, results: dict) -> None:
    try:
        from cfem.design.figure import front_figure, landscape
    except ImportError:
        return  # matplotlib comes with cfem[report]
    made = {}
    for index, name in enumerate(problem.names):
        one = designs[name]
        known = checked.get(one.z.tobytes())
        verified = None if known is None else float(known[0][index])
        made[f"landscape-{name}.png"] = landscape(problem, index, one, verified, name)
    if front:
        places = {i: checked[one.z.tobytes()][0] for i, one in enumerate(front.designs) if one.z.tobytes() in checked}
        made["front.png"] = front_figure(problem, grid, front, places)
    for name, data in made.items():
        write_whole(folder / name, data)
    results["figures"] = list(made)
