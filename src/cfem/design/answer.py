"""Results of a search for designs: design.json, tables, lines for a person."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.parameters import named, units_of
from cfem.core.artefact.judgement import DESIGN_GAP, contradicted, poor
from cfem.core.console.shown import duration, length
from cfem.dataset.writer import write_columns
from cfem.design.objectives import with_unit
from cfem.design.optimisers.front import Front
from cfem.design.optimisers.search import Design, Grid
from cfem.design.problem import DesignProblem
from cfem.design.verify import CheckedDesign
from cfem.design.volume import Volume
from cfem.parametric.differences import Stencil
from cfem.parametric.family import Family, LearnedFamily
from cfem.parametric.states import States

FEW = 3  # parameters of a design that a line may state


def entry(
    problem: DesignProblem, grid: Grid, design: Design, checked: CheckedDesign | None, volume: Volume | None
) -> dict[str, Any]:
    """Results of a design, for design.json."""
    family, p = problem.family, problem.p(design.z)
    states = family.at(problem.kind, problem.u, p[None])
    varied = [family.parameters[i] for i in problem.free]
    result = {
        "p": named(family.parameters, p),
        "units": units_of(family.parameters),
        "overrides": [parameter.override(value) for parameter, value in zip(family.parameters, p, strict=True)],
        "at_ends_of_range": [
            parameter.name for parameter, z in zip(varied, design.z, strict=True) if min(z, 1 - z) < 1e-6
        ],
        "objectives": dict(zip(problem.names, design.objectives, strict=True)),
        "said": _in_words(problem, design.objectives),
        "constraints": dict(zip(problem.constraints, design.constraints, strict=True)),
        "effector": states.x_e[0],
        "actuators": {"displacement": states.delta_a[0], "force": states.lam[0]},
        "outside": bool(getattr(family, "outside", lambda states: [])(states)),
        "uncertain": [
            name
            for name, objective in problem.objectives.items()
            if getattr(objective, "inverts", False) and not _knows_inverse(family, states, objective.rows)
        ],
        "search": f"{design.iterations} iterations: {design.message}",
    }
    if volume:
        result["volume"] = {"fitted": float(volume(p[None])[0]), "cad": volume.exact(p)}
    if checked is not None:
        gap = design.objectives - checked.objectives
        result["fe"] = {
            "objectives": dict(zip(problem.names, checked.objectives, strict=True)),
            "said": _in_words(problem, checked.objectives),
            "constraints": dict(zip(problem.constraints, checked.constraints, strict=True)),
            "gap": dict(zip(problem.names, gap, strict=True)),
            "gap_share_of_spread": dict(zip(problem.names, np.abs(gap) / grid.width, strict=True)),
            "effector_distance": checked.distance,
        }
    return result


def _knows_inverse(family: Family, states: States, rows: np.ndarray) -> bool:
    """True where a state's stiffness at the effector's rows (3,) is known; finite elements know it."""
    return not isinstance(family, LearnedFamily) or bool(family.knows_stiffness(states, rows)[0])


def _in_words(problem: DesignProblem, objectives: np.ndarray) -> dict[str, str]:
    """Objectives (n_f,) by name, each with its unit."""
    pairs = zip(problem.objectives.items(), objectives, strict=True)
    return {name: with_unit(objective, value) for (name, objective), value in pairs}


def line(name: str, entry: dict[str, Any]) -> str:
    """Line about a design, for a person."""
    single = name in entry["objectives"]
    shown = [name] if single else list(entry["objectives"])
    scores = ", ".join(entry["said"][key] if single else f"{key} {entry['said'][key]}" for key in shown)
    line = f"best {name}: {scores}" if single else f"{name}: {scores}"
    if "fe" in entry:
        worst = max(entry["fe"]["gap_share_of_spread"][key] for key in shown)
        line += (
            f"; by finite elements {', '.join(entry['fe']['said'][key] for key in shown)} (they differ by "
            f"{100 * worst:.2g} % of the spread over all designs, and by {length(entry['fe']['effector_distance'])} "
            "at the tip)"
        )
    if len(entry["p"]) <= FEW:
        line += f"; {parameters(entry['p'], entry['units'])}"
    return line + ("; outside what the model was trained on" if entry["outside"] else "")


def parameters(p: dict[str, float], units: dict[str, str]) -> str:
    """Parameters of a design, for a person; of more than a few it says where they are."""
    if len(p) > FEW:
        return f"a design whose {len(p)} parameters are in design.json"
    return ", ".join(f"{key} {value:.4g} {units.get(key, '')}".rstrip() for key, value in p.items())


def unchecked(designs: dict[str, Any]) -> list[dict[str, Any]]:
    """Findings where the model's answer is no more than a guess, and finite elements have not checked it."""
    findings = []
    for name, entry in designs.items():
        if "fe" in entry:
            continue
        if entry["outside"]:
            findings.append(poor(f"design {name} is outside what the model was trained on: check it with `verify: fe`"))
        shown = [name] if name in entry["objectives"] else list(entry["objectives"])
        for key in (key for key in shown if key in entry["uncertain"]):
            what = f"{key} inverts the compliance of the tip, whose smallest part is less than the model's own error"
            findings.append(poor(f"design {name}: {what}: check it with `verify: fe`"))
    return findings


def contradictions(designs: dict[str, Any]) -> list[dict[str, Any]]:
    """Findings where finite elements find something else than the model, of what each design is best at."""
    findings = []
    for name, entry in designs.items():
        if "fe" not in entry:
            continue
        shown = [name] if name in entry["objectives"] else list(entry["objectives"])
        for key in shown:
            model, fe = entry["objectives"][key], entry["fe"]["objectives"][key]
            in_words = [part["said"][key] for part in (entry["fe"], entry)]
            apart = abs(model - fe) > DESIGN_GAP * max(abs(model), abs(fe))
            if apart and entry["fe"]["gap_share_of_spread"][key] > DESIGN_GAP:
                findings.append(
                    contradicted(
                        f"design {name}: finite elements give {key} {in_words[0]}, the model {in_words[1]}: "
                        f"they differ by {100 * entry['fe']['gap_share_of_spread'][key]:.0f} % of its spread over all "
                        "designs"
                    )
                )
    return findings


def front_entry(front: Front) -> dict[str, Any]:
    """Results of the front, for design.json."""
    return {
        "of": front.names,
        "designs": len(front.designs),
        "corners": front.corners,
        "hypervolume": front.volume,
        "grid_hypervolume": front.grid_volume,
        "beaten_by_grid": front.beaten,
    }


def front_line(front: Front, seconds: float) -> str:
    """Line about the front, for a person."""
    text = f"front: {len(front.designs)} designs in {duration(seconds)} of CPU time"
    text += f"; hypervolume {front.volume:.4f} of 1, where the designs of the grid have {front.grid_volume:.4f}"
    return f"{text}; {front.beaten} designs of the grid are better than one of the front in every objective"


def write_front(path: Path, problem: DesignProblem, front: Front) -> None:
    z, objectives, constraints = (
        np.array([getattr(design, name) for design in front.designs]) for name in ("z", "objectives", "constraints")
    )
    write_designs(path, problem, z, objectives, constraints)


def write_designs(
    path: Path, problem: DesignProblem, z: np.ndarray, objectives: np.ndarray, constraints: np.ndarray
) -> None:
    """A row a design: parameters, objectives as they are minimised, slacks of the constraints."""
    p = problem.p(z)
    columns = {parameter.name: p[:, i] for i, parameter in enumerate(problem.family.parameters)}
    columns |= {f"objective.{name}": objectives[:, i] for i, name in enumerate(problem.names)}
    columns |= {f"slack.{name}": constraints[:, i] for i, name in enumerate(problem.constraints)}
    meta = {
        "units": {parameter.name: parameter.unit for parameter in problem.family.parameters},
        "kind": problem.kind,
        "u": problem.u.tolist(),
    }
    write_columns(path, columns, meta)


def slopes_checked(problem: DesignProblem) -> float:
    """Largest difference between the slopes that the search uses and those by plain central differences, relative to
    each row's largest, at the middle of the ranges."""
    z = np.full(len(problem.free), 0.45)
    used, plain = problem.with_slopes(z)[1], problem.with_slopes(z, Stencil(2, 1e-4))[1]
    size = np.abs(used).max(axis=1, keepdims=True)
    return float((np.abs(used - plain) / np.where(size > 0, size, 1.0)).max(initial=0.0))
