"""The shapes that a robot went through in a run of `cfem control`: those of finite elements where the run kept them,
and those of the learned skin, which need none."""

import json
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.task.run_spec import FE_BASED
from cfem.core.artefact.content import artefact_content, artefact_file
from cfem.core.errors import InputError
from cfem.core.reading import read_npz
from cfem.dataset.parquet import read_parquet
from cfem.predict.load import has_skin, load_model
from cfem.predict.loads.loaded import loaded, wrench_of
from cfem.predict.loads.spec import LoadSpec, loads_of
from cfem.predict.protocol import Predictor

FE, LEARNED = "fe", "learned"


@dataclass(frozen=True)
class ShapeHistory:
    """Shapes along one trajectory.

    kind: 'fe' or 'learned'
    rest: (m, 3) mm
    facets: (t, 3, 4 or 6) nodes
    x: (f, m, 3) mm
    index: (f,) of each shape among the rows of the run
    times: (f,) seconds of a loop, else the number of the goal
    in_seconds: which of the two
    facts: (f, ...) numbers of each shape by name
    goals, reached: (n, 3) mm of all rows
    errors: (n,) mm
    objects: number of the last nodes, which are of an object that robots hold"""

    name: str
    kind: str
    rest: np.ndarray
    facets: np.ndarray
    x: np.ndarray
    index: np.ndarray
    times: np.ndarray
    in_seconds: bool
    facts: Mapping[str, np.ndarray]
    goals: np.ndarray
    reached: np.ndarray
    errors: np.ndarray
    objects: int = 0


@dataclass(frozen=True)
class _Trajectory:
    """Rows of the first controller of a run on one trajectory.

    model: its name, None of FE-based control
    columns: (n, ...) of the run's table
    names: of effector rows, then of actuators"""

    name: str
    model: str | None
    columns: Mapping[str, np.ndarray]
    names: list[str]
    units: tuple[list[str], list[str]]

    def history(
        self, kind: str, rest: np.ndarray, facets: np.ndarray, x: np.ndarray, index: np.ndarray, objects: int = 0
    ) -> ShapeHistory:
        """Shapes x (f, m, 3) mm of a kind, with the columns of the run."""
        first_row = self._first_point()
        in_seconds = "tick" in self.columns
        return ShapeHistory(
            name=self.name,
            kind=kind,
            rest=rest,
            facets=facets,
            x=x,
            index=index,
            times=self.columns["seconds" if in_seconds else "goal_index"].astype(float)[index],
            in_seconds=in_seconds,
            facts=self._facts(index),
            goals=self.columns["goal"][:, first_row : first_row + 3],
            reached=self.columns["x_e"][:, first_row : first_row + 3],
            errors=self.columns["error"],
            objects=objects,
        )

    def _first_point(self) -> int:
        """Column of the x of the first watched point; orientations are no points."""
        n_e = self.columns["goal"].shape[1]
        return next((i for i, name in enumerate(self.names[:n_e]) if name.endswith(".x")), 0)

    def _facts(self, index: np.ndarray) -> dict[str, np.ndarray]:
        """Facts beside each shape, by name."""
        first_row, actuators = self._first_point(), self.names[self.columns["goal"].shape[1] :]
        facts = {"error [mm]": self.columns["error"], "goal [mm]": self.columns["goal"][:, first_row : first_row + 3]}
        facts["position [mm]"] = self.columns["x_e"][:, first_row : first_row + 3]
        for key, units in zip(("delta_a", "lambda_a"), self.units, strict=True):
            if key in self.columns:
                of_each = zip(actuators, units, self.columns[key].T, strict=True)
                facts |= {f"{key} {name} [{unit}]" if unit else f"{key} {name}": row for name, unit, row in of_each}
        return {name: values[index] for name, values in facts.items()}


def histories(
    folder: Path, manifest: Mapping[str, Any], most: int = 60, kinds: Collection[str] = (FE, LEARNED)
) -> Iterator[ShapeHistory]:
    """Shapes of every trajectory of a run: FE shapes where it kept them, then those of the learned skin where the model
    has one, at most `most`, evenly spread. kinds: those that are wanted. InputError where the model is no longer the
    one of the run."""
    states = read_npz(artefact_file(folder, "states.npz")) if FE in kinds and "states.npz" in manifest["files"] else {}
    models: dict[str, Predictor | None] = {}
    for trajectory_rows in _trajectories(folder, manifest):
        if f"{trajectory_rows.name}/x" in states:
            x, objects = states[f"{trajectory_rows.name}/x"].astype(float), int(states.get("object_points", 0))
            yield trajectory_rows.history(
                FE, states["X"], states["facets"], x, states[f"{trajectory_rows.name}/index"], objects
            )
        moved = manifest["spec"].get("object") or manifest["spec"].get("design")
        if LEARNED not in kinds or trajectory_rows.model is None or moved:
            continue  # which moves or changes the robot that the skin is of
        if trajectory_rows.model not in models:
            models[trajectory_rows.model] = _model(folder, manifest, trajectory_rows.model)
        model = models[trajectory_rows.model]
        good = np.flatnonzero(np.isfinite(trajectory_rows.columns["delta_a"]).all(axis=1))
        if model is None or not len(good):
            continue
        index = good[np.linspace(0, len(good) - 1, min(most, len(good))).round().astype(int)]
        x = model.shape(trajectory_rows.columns["delta_a"][index])
        yield trajectory_rows.history(LEARNED, model.skin.rest, model.facets, x, index)


def _trajectories(folder: Path, manifest: Mapping[str, Any]) -> Iterator[_Trajectory]:
    """Trajectories of a run, each with its first controller's columns."""
    looped = "loop" in manifest["results"]
    table = read_parquet(artefact_file(folder, "loop.parquet" if looped else "trajectories.parquet"))
    columns = {name: np.array(table[name].to_pylist()) for name in table.column_names}
    meta = json.loads(table.schema.metadata[b"cfem"])
    spec = manifest["spec"]
    first = next(iter(spec["models"]))
    units = tuple(_each(meta["units"].get(key, ""), columns["delta_a"].shape[1]) for key in ("delta_a", "lambda_a"))
    for trajectory in dict.fromkeys(columns["trajectory"].tolist()):
        shown = columns["trajectory"] == trajectory
        who = next(iter(spec["loop"]["controllers"])) if looped else first
        shown &= columns["controller"] == who
        if looped:
            shown &= columns["seed"] == columns["seed"][shown][0]
        model = (spec["loop"]["controllers"][who]["model"] or first) if looped else first
        rows = {name: values[shown] for name, values in columns.items()}
        yield _Trajectory(trajectory, None if model == FE_BASED else model, rows, meta["rows"], units)


def _each(unit: str | list[str], count: int) -> list[str]:
    return [unit] * count if isinstance(unit, str) else list(unit)


def _model(folder: Path, manifest: Mapping[str, Any], name: str) -> Predictor | None:
    """The model of the run, under its loads; None where it has no skin."""
    path, origin = folder / manifest["inputs"][f"model {name}"], manifest["origin"] or {"inputs": {}}
    if origin["inputs"].get(f"model {name}") != artefact_content(path):
        raise InputError(f"is not the model '{name}' that this run used", where=str(path), do="run cfem control again")
    if not has_skin(path):
        return None
    model, loads = load_model(path), manifest["spec"].get("loads")
    if not loads or model.meta.get("wrench") is not None:
        return model
    stated = {name: LoadSpec.model_construct(**load) for name, load in loads.items()}  # in mm and N, as recorded
    forces, patches = loads_of(stated, model.meta.get("masses", {}))
    return loaded(model, wrench_of(model.rows, forces), patches, trusted=np.inf)  # the run has judged it
