"""Two questions of the paper, as rows: where to sample, and what a finer mesh asks of a model and of control."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from cfem.control.summary import FE_BASED
from cfem.core.errors import InputError
from cfem.report.spec import Published


def sampling_rows(method: str, model: str, trained: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row a number of training rows, of all the learning curves of results of `cfem train`, in that order."""
    rows = [
        {"method": method, "model": model, "kind": results["kind"], **point}
        for results in trained
        for point in results["learning_curve"]
    ]
    return sorted(rows, key=lambda row: row["samples"])


def mesh_row(
    name: str,
    mesh: Mapping[str, Any],
    model: Mapping[str, Any],
    control: Mapping[str, Any],
    published: Published | None,
) -> dict[str, Any]:
    """From results of `cfem mesh`, `cfem train` and `cfem control`. steps: inverse steps a second, query or FE solve
    included, the median; missed_mm: mean distance to the goals in reach."""
    controllers = list(control["trajectories"].values())
    if not all(FE_BASED in one for one in controllers):
        raise InputError("lacks FE-based control", where=f"meshes: {name}", do="control it with fe_based: true")
    learned = next(one for one in controllers[0] if one != FE_BASED and "@" not in one)
    return {
        "name": name,
        "cells": mesh["cells"],
        "nodes": mesh["nodes"],
        "kind": model["kind"],
        "curve": model["learning_curve"],
        "steps_learned": _steps(controllers, learned),
        "steps_fe": _steps(controllers, FE_BASED),
        "missed_learned_mm": _missed(controllers, learned),
        "missed_fe_mm": _missed(controllers, FE_BASED),
        "published": published.model_dump() if published else None,
    }


def _steps(controllers: list[Mapping[str, Any]], name: str) -> float:
    return 1e6 / float(np.median([one[name]["step_us"]["median"] for one in controllers]))


def _missed(controllers: list[Mapping[str, Any]], name: str) -> float | None:
    spreads = [one[name]["distance_to_reachable_goals"] for one in controllers]
    means = [spread["mean"] for spread in spreads if spread]
    return float(np.mean(means)) if means else None
