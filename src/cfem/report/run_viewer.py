"""Viewer of a control run: the robot's shapes along its goals, to turn and play in a page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.report.sections.robot import LINES, cables_of, moved_with
from cfem.report.sections.tracking import Tracking
from cfem.report.shape_history import FE, LEARNED, ShapeHistory, histories
from cfem.report.viewer import BODY, OBJECT, Polyline, Take, Viewer, flat_triangles
from cfem.robot.spec import SceneSpec

CAPTION = "The {} at its goals (circles); red: its way. Shapes between goals are interpolated. Drag to turn."
WHO = {FE: "finite-element robot", LEARNED: "robot by its learned skin, without finite elements,"}


def animation(folder: Path, manifest: Mapping[str, Any], tracking: Tracking, scene: SceneSpec) -> Viewer | None:
    """Viewer of the robot along every trajectory of an artefact of `cfem control`: the FE shapes that it kept, or
    without any those of the learned skin; None without either."""
    taken = list(histories(folder, manifest, kinds=(FE,))) or _learned(folder, manifest)
    if not taken:
        return None
    best = sorted(
        taken, key=lambda history: -tracking.summaries[history.name][tracking.learned(history.name)]["reachable"]
    )
    return viewer_of("tracked", best, None if tracking.spec.get("design") else scene)


def viewer_of(name: str, taken: Sequence[ShapeHistory], scene: SceneSpec | None) -> Viewer:
    """Viewer of courses of one surface; with the cables of the scene, where it is given and the robot is alone."""
    first = taken[0]
    triangles = flat_triangles(first.facets)
    kinds = np.where((triangles >= len(first.rest) - first.objects).all(axis=1), OBJECT, BODY)
    cables = [] if scene is None or first.objects else cables_of(scene)
    takes = tuple(_take(history, cables) for history in taken)
    return Viewer(name, CAPTION.format(WHO[first.kind]), triangles, kinds, takes)


def _take(history: ShapeHistory, cables: Sequence[tuple[str, np.ndarray, int]]) -> Take:
    lines = tuple(
        Polyline(label, LINES[place % len(LINES)], moved_with(points, held, history.rest, history.x))
        for place, (label, points, held) in enumerate(cables)
    )
    return Take(history.name, history.x, history.index.tolist(), history.goals, history.reached, history.errors, lines)


def _learned(folder: Path, manifest: Mapping[str, Any]) -> list[ShapeHistory]:
    """Histories of the learned model in a run; none where its model is gone, which the page can do without."""
    try:
        return list(histories(folder, manifest, kinds=(LEARNED,)))
    except InputError:
        return []
