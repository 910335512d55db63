"""`cfem optimize-design`: from what is asked of a design to the designs that do it best."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.actuator_units import demand_units
from cfem.core.artefact.files import write_json, write_whole
from cfem.core.console.shown import duration, length
from cfem.core.optional import installed
from cfem.core.spec import load_spec
from cfem.core.stage import Command
from cfem.design.objective_spec import BodySpec, FrequencySpec, FunctionSpec
from cfem.design.spec import ConstraintFunction, DesignSpec
from cfem.robot.spec import SceneSpec, scene_meaning

RESULT, GRID, FRONT = "design.json", "grid.parquet", "front.parquet"


def _paths(spec: DesignSpec, base: Path) -> dict[str, Path]:
    """Paths of what the spec names and needs."""
    named = {name: base / getattr(spec, name) for name in ("model", "scene", "mesh") if getattr(spec, name) is not None}
    return {name: path for name, path in named.items() if name != "mesh" or spec.by_finite_elements or spec.cad}


def _sources(spec: DesignSpec, base: Path) -> dict[str, Path]:
    """Files of the user's own functions and of a policy: their text decides the output."""
    named = [objective.function for objective in spec.objectives.values() if isinstance(objective, FunctionSpec)]
    named += [
        constraint.function for constraint in spec.constraints.values() if isinstance(constraint, ConstraintFunction)
    ]
    files = {function.rpartition(":")[0] for function in named}
    policy = {"policy": base / spec.task.policy} if spec.task and spec.task.policy else {}
    return policy | {f"function {file}": base / file for file in sorted(files) if file.endswith(".py")}


def _work(folder: Path, spec: DesignSpec, base: Path) -> dict[str, Any]:
    """Results: the best design by every objective and blend, the front, the task, each verified."""
    from cfem.design.answer import contradictions, unchecked
    from cfem.design.formulation import problem_of, task_of
    from cfem.design.page import write_page
    from cfem.parametric.load import differentiable, finite_elements, learned

    paths = _paths(spec, base)
    if spec.by == "fe":
        fields = [objective.kind for objective in spec.objectives.values() if isinstance(objective, BodySpec)]
        fields += [objective.number for objective in spec.objectives.values() if isinstance(objective, FrequencySpec)]
        family = differentiable(paths["scene"], paths["mesh"], spec.parameters, fields)
    else:
        family = learned(paths["model"], paths.get("scene"))
    demand_units(spec, family.actuator_units)
    exact = None
    if spec.verify != "no":
        exact = finite_elements(paths["scene"], paths["mesh"], family.parameters, remesh=True)
    results: dict[str, Any] = {"judgement": [], "headline": []}
    task = task_of(spec, family.rows) if spec.task else None
    if spec.objectives:
        problem, volume = problem_of(spec, family, paths.get("scene"), base)
        search = _search(spec, problem)
        checked = _verify(problem, exact, search.designs, search.front, spec)
        reported, lines = _report(folder, spec, problem, volume, search, checked)
        results |= reported
        results["headline"] += lines
        results["judgement"] += contradictions(results["designs"]) + unchecked(results["designs"])
        optima = {}
        if spec.refine:
            results["refined"], optima = _refine(spec, paths, base, problem, search.grid, results)
        results |= _products(folder, spec, paths, problem, search.designs | optima, results["headline"])
        _tell_meshes(family if spec.by == "fe" else exact, problem, results)
        if spec.page:
            results["page"] = write_page(folder, problem, search.front, exact, results.get("sensitivity"))
        if spec.figures and installed("matplotlib"):
            results["figures"] = _draw(folder, problem, search, checked)
    if spec.task:
        from cfem.design.served import serve_and_tell

        results["task"] = serve_and_tell(spec, task, family, exact, results, base)
    write_json(folder / RESULT, {key: value for key, value in results.items() if key != "headline"})
    return results


@dataclass(frozen=True)
class _Search:
    """Designs that a search has found."""

    grid: Any
    designs: dict[str, Any]  # by what each is best at
    front: Any | None
    seconds: dict[str, float]  # CPU time of each part


def _search(spec: DesignSpec, problem: Any) -> _Search:
    """Designs that the spec asks for: the grid, the best by each objective, and the front."""
    from cfem.design.optimisers.front import best_of_each, pareto_front
    from cfem.design.optimisers.search import Scalar, best, first_designs

    seconds = {}
    begin = time.process_time()
    grid = problem.screen(spec.screen, problem.z(problem.p0)) if spec.by == "fe" else first_designs(problem, spec.grid)
    seconds["grid"], begin = time.process_time() - begin, time.process_time()
    designs = dict(zip(problem.names, best_of_each(problem, grid, spec.starts), strict=True))
    for name, weights in spec.blends.items():
        row = Scalar.weighted(np.array([weights.get(objective, 0.0) for objective in problem.names]))
        designs[name] = best(problem, grid, row, spec.starts)
    seconds["search"], begin = time.process_time() - begin, time.process_time()
    if not spec.front:
        return _Search(grid, designs, None, seconds)
    ends = [designs[name] for name in spec.front.of]
    front = pareto_front(problem, grid, spec.front.of, spec.front.points, ends)
    seconds["front"] = time.process_time() - begin
    corners = {f"front {name}": front.designs[place] for name, place in front.corners.items()}
    return _Search(grid, designs | corners, front, seconds)


def _report(
    folder: Path, spec: DesignSpec, problem: Any, volume: Any, search: _Search, checked: dict[bytes, Any]
) -> tuple[dict[str, Any], list[str]]:
    """Results of a search, and their lines for a person; writes tables into the folder."""
    from cfem.design.answer import front_line, line, write_designs, write_front
    from cfem.design.optimisers.sensitivity import account_of

    results, lines = _search_results(problem, volume, search, checked), []
    if spec.sensitivity:
        results["sensitivity"], lines = account_of(problem, spec.sensitivity)
    if volume:
        what = "volume: a polynomial through CAD models; largest error at other designs"
        lines.append(f"{what} {volume.error:.1e} mm^3")
    lines += [line(name, design) for name, design in results["designs"].items()]
    if search.front:
        lines.append(front_line(search.front, search.seconds["front"]))
        write_front(folder / FRONT, problem, search.front)
    write_designs(folder / GRID, problem, search.grid.z, *search.grid.scores)
    return results, [*lines, _cost_line(results)]


def _search_results(problem: Any, volume: Any, search: _Search, checked: dict[bytes, Any]) -> dict[str, Any]:
    """Results of a search as plain data."""
    from cfem.design.answer import entry, front_entry, slopes_checked
    from cfem.design.fe import FeProblem

    grid, by_fe = search.grid, isinstance(problem, FeProblem)
    results: dict[str, Any] = {
        "grid": {"designs": len(grid.z), "feasible": int(grid.scores.feasible.sum())},
        "spread": {
            name: [float(low), float(low + width)]
            for name, low, width in zip(problem.names, grid.low, grid.width, strict=True)
        },
        "designs": {
            name: entry(problem, grid, design, checked.get(design.z.tobytes()), volume)
            for name, design in search.designs.items()
        },
        "slopes_checked": problem.slope_error(problem.z(problem.p0)) if by_fe else slopes_checked(problem),
        "seconds": search.seconds,
        "evaluations": problem.evaluations,
        "signs": {name: getattr(objective, "sign", 1.0) for name, objective in problem.objectives.items()},
    }
    if volume:
        results["volume_error"] = volume.error
    if search.front:
        results["front"] = front_entry(search.front)
    if by_fe:
        results |= {"solves": problem.family.solves, "failed": problem.failed}
    return results


def _cost_line(results: dict[str, Any]) -> str:
    """Sentence on what the search took, and on how far its derivatives can be trusted."""
    error, seconds = f"{results['slopes_checked']:.0e}", results["seconds"]
    if "solves" in results:
        return (
            f"{results['solves']} finite-element solves in {duration(sum(seconds.values()))} of CPU time, "
            f"{results['failed']} designs failed; derivatives agree with finite differences to {error} of solves "
            "along one direction"
        )
    return (
        f"{results['grid']['designs']} designs in {duration(seconds['grid'])} of CPU time; derivatives agree with "
        f"finite differences of second order to {error}"
    )


def _refine(
    spec: DesignSpec, paths: dict[str, Path], base: Path, problem: Any, grid: Any, outcome: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Results, and the designs by a name of theirs; lines go into outcome["headline"], doubts into
    outcome["judgement"]."""
    from cfem.design.formulation import problem_of
    from cfem.design.optimisers.refined import account_of, refine_all
    from cfem.parametric.differentiable import Differentiable
    from cfem.robot.load import load_scene_and_mesh

    scene = paths["scene"]
    scene_and_mesh = load_scene_and_mesh(scene, paths["mesh"])
    family = Differentiable(*scene_and_mesh, problem.family.parameters, folder=scene.parent)
    exact, _ = problem_of(spec.model_copy(update={"by": "fe"}), family, None, base)
    refined = refine_all(spec, problem, exact, grid)
    results, lines, doubts = account_of(problem, refined)
    outcome["headline"] += lines
    outcome["judgement"] += doubts
    _tell_meshes(family, problem, outcome)
    return results, {f"{name} by finite elements": of_objective.best for name, of_objective in refined.items()}


def _tell_meshes(family: Any, problem: Any, outcome: dict[str, Any]) -> None:
    """Notes designs that have meshes of their own in the results and the headline."""
    if family is None or not family.meshes.own:
        return
    from cfem.condensed.parameters import units_of
    from cfem.design.answer import parameters

    jumps = family.jumps(problem.kind, problem.u)
    outcome["meshes"] = [*outcome.get("meshes", []), *jumps]
    units = units_of(family.parameters)
    for jump in jumps:
        values = parameters(jump["p"], units)
        line = f"the scene's mesh does not stretch to {values}, which has a mesh of its own of {jump['cells']} cells"
        if jump["W_share"] is not None:
            line += f": where it takes over, W jumps by {100 * jump['W_share']:.2g} % and the effector"
            line += f" by {length(jump['effector_distance'])}"
        outcome["headline"].append(line)


def _products(
    folder: Path, spec: DesignSpec, paths: dict[str, Path], problem: Any, designs: dict[str, Any], headline: list[str]
) -> dict[str, Any]:
    """Writes the shapes and controllers that are asked for."""
    if not spec.cad and spec.controller is None:
        return {}
    from cfem.design.products import write_controllers, write_shapes
    from cfem.robot.load import load_scene_and_mesh

    parameters, scene = problem.family.parameters, load_spec(paths["scene"], SceneSpec) if "scene" in paths else None
    chosen = {name: problem.p(design.z) for name, design in designs.items()}
    if spec.cad:
        mesh = None
        if scene is not None and scene.shape is not None and "mesh" in paths:
            _, mesh = load_scene_and_mesh(paths["scene"], paths["mesh"])
        note = write_shapes(folder, chosen, parameters, scene, mesh)
        headline += [note] if note else []
    if spec.controller is None:
        return {}
    reports = write_controllers(folder, chosen, parameters, paths["model"], spec.controller, scene)
    parities = [report["parity"] for report in reports.values()]
    compared = (
        "not compared, there is no C compiler here"
        if None in parities
        else f"largest relative difference from the model {max(parities):.1e}"
    )
    headline.append(f"controllers in C of {len(reports)} designs: {compared}")
    return {"controllers": reports}


def _verify(problem: Any, exact: Any, designs: dict, front: Any, spec: DesignSpec) -> dict[bytes, Any]:
    """Checked designs by z, by finite elements."""
    from cfem.design.verify import verify

    if exact is None:
        return {}
    wanted = [design.z for design in designs.values()]
    if front and spec.verify == "fe-front":
        wanted += [design.z for design in front.designs]
    unique = list({z.tobytes(): z for z in wanted}.values())
    return dict(zip([z.tobytes() for z in unique], verify(problem, exact, unique), strict=True))


def _draw(folder: Path, problem: Any, search: Any, checked: dict[bytes, Any]) -> list[str]:
    """Draws landscapes and front into the folder, and returns the names of the files."""
    from cfem.design.fe import FeProblem
    from cfem.design.figure import front_figure, landscape

    pictures = {}
    for index, name in enumerate([] if isinstance(problem, FeProblem) else problem.names):
        design = search.designs[name]
        known = checked.get(design.z.tobytes())
        verified = None if known is None else float(known.objectives[index])
        pictures[f"landscape-{name}.png"] = landscape(problem, index, design, verified, name)
    front = search.front
    if front:
        places = {
            i: checked[of_front.z.tobytes()].objectives
            for i, of_front in enumerate(front.designs)
            if of_front.z.tobytes() in checked
        }
        pictures["front.png"] = front_figure(problem, search.grid, front, places)
    for name, data in pictures.items():
        write_whole(folder / name, data)
    return list(pictures)


COMMAND = Command(
    "optimize-design",
    3,
    DesignSpec,
    _work,
    outside=("model", "scene", "mesh"),
    reads=lambda spec, base: (
        {name: path for name, path in _paths(spec, base).items() if name != "scene"} | _sources(spec, base)
    ),
    extra=lambda spec, base: {"scene": scene_meaning(base / spec.scene)} if spec.scene else {},
)
run, stage = COMMAND.run, COMMAND.stage
