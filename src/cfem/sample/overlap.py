"""Whether parts of the body pass through each other in the states of a skeleton: without self-contact, or where walls
have no partners."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.contact.surface.overlap import ALLOWED, Boundary
from cfem.core.artefact.judgement import poor
from cfem.core.console.shown import length

FILE = "overlap.json"  # beside the skeleton


def overlaps(boundary: Boundary, states: Sequence[np.ndarray]) -> dict[str, Any]:
    """Figures on the states x (n, 3) mm, as plain data: how many there are, in how many any part passes through
    another, the largest depth, and where that is in the body at rest."""
    depths = [boundary.overlap(x) for x in states]
    deepest = max(depths, key=lambda each: each.depth)
    place = boundary.rest[deepest.node].tolist() if deepest.depth else None
    count = sum(each.depth > 0 for each in depths)
    return {"states": len(depths), "overlapping": count, "depth_mm": deepest.depth, "place_mm": place}


def read_overlap(folder: Path) -> dict[str, Any] | None:
    """Figures beside a skeleton, None where there are none."""
    file = folder / FILE
    return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None


def deeper(first: Mapping[str, Any] | None, second: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Figures on the states of two skeletons together."""
    known = [dict(each) for each in (first, second) if each]
    if len(known) < 2:
        return known[0] if known else None
    sums = {key: sum(each[key] for each in known) for key in ("states", "overlapping")}
    return {**max(known, key=lambda each: each["depth_mm"]), **sums}


def finding(overlap: Mapping[str, Any] | None, body: float) -> list[dict[str, Any]]:
    """The finding that parts of a robot pass through each other by more than ALLOWED of its length `body` mm; none
    where they do not."""
    if overlap is None or overlap["depth_mm"] <= ALLOWED * body:
        return []
    depth, place = overlap["depth_mm"], ", ".join(f"{number:.3g}" for number in overlap["place_mm"])
    share = f"{length(depth)} ({100 * depth / body:.2g} % of the length)"
    return [
        poor(
            f"parts of the body pass through each other by {share}, at ({place}) mm of the body at rest, and in "
            f"{overlap['overlapping']} of {overlap['states']} states spread over the plan, so that forces are too low "
            "there. Set `self_contact: true` in the scene (a larger `within` where it has it), or reduce the reach. "
            "`cfem control` knows outer surfaces that touch each other where an obstacle is of kind itself"
        )
    ]
