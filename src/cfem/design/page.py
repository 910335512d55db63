"""The front as a page to explore: click a design, and see its shape move and what it is. One file, no network."""

import json
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import write_whole
from cfem.design.optimisers.front import Front
from cfem.design.problem import DesignProblem
from cfem.report.page import document
from cfem.report.viewer import BODY, HELD, Take, Viewer, flat_triangles

PAGE = "front.html"
STEPS = 7  # shapes from rest to the whole pull


def moving(problem: DesignProblem, exact: Any, designs: Sequence[Any]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Motion of each design by finite elements: x (STEPS, n, 3) mm the nodes from rest to the full actuation, and x_e
    (STEPS, n_e) mm the effectors."""
    moves = []
    for design in designs:
        p = problem.p(design.z)
        shapes, tips = [], []
        for share in np.linspace(0, 1, STEPS):
            states = exact.at(problem.kind, share * problem.u, p[None])
            shapes.append(exact.nodes)
            tips.append(states.x_e[0])
        moves.append((np.array(shapes), np.array(tips)))
    return moves


def write_page(
    folder: Path, problem: DesignProblem, front: Front, exact: Any, sensitivity: dict[str, Any] | None
) -> str:
    """Solves what the page shows, and writes it; its name. exact: cfem.parametric.family.FiniteElementFamily. Designs
    on meshes of their own are left out."""
    shapes = moving(problem, exact, front.designs)
    count = len(exact.robot.X)
    kept = [i for i, (x, _) in enumerate(shapes) if x.shape[1] == count]  # those on the scene's mesh
    front = replace(front, designs=tuple(front.designs[i] for i in kept))
    shapes = [shapes[i] for i in kept]
    write_whole(folder / PAGE, front_page(problem, front, exact.robot, shapes, sensitivity).encode())
    return PAGE


def front_page(
    problem: DesignProblem, front: Front, robot: Any, shapes: list, sensitivity: dict[str, Any] | None
) -> str:
    """Page of the front. robot: cfem.equilibrium.system.robot.Robot, any of the family's."""
    triangles = flat_triangles(robot.facets)
    held = np.isin(triangles, robot.fixed).all(axis=1)
    takes = tuple(
        Take(f"design {i + 1}", x, range(STEPS), tips[:, :3], tips[:, :3], [0.0] * STEPS)
        for i, (x, tips) in enumerate(shapes)
    )
    viewer = Viewer(
        "front",
        "The design from rest to the full pull, by finite elements.",
        triangles,
        np.where(held, HELD, BODY),
        takes,
    )
    parameters = problem.parameters
    data = {
        "objectives": list(front.names),
        "values": [[float(design.objectives[k]) for k in front.indices] for design in front.designs],
        "parameters": [{"name": parameter.name, "unit": parameter.suffix.strip()} for parameter in parameters],
        "designs": [problem.p(design.z)[list(problem.free)].tolist() for design in front.designs],
        "shares": [design.z.tolist() for design in front.designs],
        "matters": {} if sensitivity is None else {k: v["total"] for k, v in sensitivity.items() if k in front.names},
    }
    style, script = ((files("cfem.design") / name).read_text(encoding="utf-8") for name in ("front.css", "front.js"))
    data_text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    main = (
        f"<h1>{escape(robot.name)}: {len(front.designs)} designs of the front</h1>"
        '<p class="lead">No other design is better in one objective without being worse in another. '
        "Smaller numbers are better. Click a design, or use the arrow keys.</p>"
        f'<div class="explore"><div><div id="axes"></div><svg id="front" viewBox="0 0 460 380" role="img" '
        f'aria-label="the front"></svg></div>{viewer.html()}</div>'
        f'<div class="explore"><div id="design"></div><div id="matters"></div></div>'
    )
    return document(f"{robot.name}: front", main, style, data_text, script)
