"""The files of a dataset folder and what its manifest says of them."""

import shutil
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cfem.condensed.discrepancy import BEYOND
from cfem.condensed.parameters import from_json, sampled
from cfem.condensed.skin import Skin, read_skin
from cfem.core.artefact.files import write_whole
from cfem.core.artefact.judgement import FAILED_SHARE, poor
from cfem.core.artefact.manifest import read_manifest
from cfem.core.console.shown import counted, duration, length
from cfem.core.errors import InputError, NumericalError
from cfem.core.units import parse_quantity
from cfem.dataset.inspect import cost
from cfem.dataset.reader import CONVERGED, column_array, read_table
from cfem.dataset.schema import SKIN, metadata, rows_of
from cfem.dataset.writer import content_hash, write_table
from cfem.sample.overlap import deeper, finding, read_overlap
from cfem.sample.parameters import is_of_motion
from cfem.sample.processes.pool import with_workers
from cfem.sample.processes.workers import Workers
from cfem.sample.runner import sample
from cfem.sample.skin import TOLERANCE
from cfem.sample.solver import SolverFactory
from cfem.sample.spec import SampleSpec

FILLED, FEW = 0.5, 8  # of a reach that states have to fill, and how many states are too few to tell
DEAR = 4.0  # times the mean number of factorisations: a state that is named


def fill(
    folder: Path, spec: SampleSpec, factory: SolverFactory, made_from: str, workers: Workers, known: Path | None = None
) -> dict[str, Any]:
    """Writes one Parquet file a split into `folder`; returns results for the manifest. known: folder of a dataset of
    the first rows, which are kept."""
    begin = time.perf_counter()
    files = {split: folder / f"{split}.parquet" for split in spec.splits}
    shards = folder / "shards"
    try:
        tables = {split: read_table(file) for split, file in files.items()}
    except InputError:  # not there yet
        tables = with_workers(
            workers, lambda executor: sample(spec, factory, shards, executor, made_from, workers.timeout, known)
        )
        keep_skin(shards, folder)
        for split, table in tables.items():
            write_table(files[split], table)
    before = None if known is None else (read_manifest(known)["results"] or {}).get("overlap")
    outcome = results(tables, kept_skin(folder), deeper(read_overlap(shards), before))
    shutil.rmtree(shards, ignore_errors=True)
    if known is not None:
        kept = sum(len(read_table(known / file.name)) for file in files.values())
        outcome["kept"] = kept
        outcome["headline"].append(f"{kept} of the states were there before, and were kept")
    return {**outcome, "wall_seconds": time.perf_counter() - begin, "content": content_hash(tables)}


def keep_skin(shards: Path, folder: Path) -> None:
    """Copies the file of the skin to the dataset's folder, if there is one."""
    if (shards / SKIN).exists():
        write_whole(folder / SKIN, (shards / SKIN).read_bytes())


def kept_skin(folder: Path) -> Skin | None:
    """The skin of a dataset's folder, if there is one."""
    return read_skin(folder / SKIN) if (folder / SKIN).exists() else None


def results(
    tables: dict[str, pa.Table], skin: Skin | None = None, overlap: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Results of the sampling, and its cost; overlap: figures on the skeleton. Raises NumericalError where no row of a
    split converged."""
    for split, table in tables.items():
        if not pc.any(pc.equal(table["status"], CONVERGED)).as_py():
            raise NumericalError(f"no row of '{split}' converged: {table['reason'][0]}", where="sample")
    table = pa.concat_tables(tables.values())
    solved = table.filter(pc.equal(table["status"], CONVERGED))
    failed = len(table) - len(solved)
    costs, skin_figures = cost(table), None if skin is None else skin_results(solved, skin)
    worst = pc.max(solved["residual"]).as_py()
    return {
        "headline": [
            f"{len(solved)} of {len(table)} states converged, largest residual {worst:.1e}; "
            f"per state {costs['factorizations_per_sample']:.2f} factorisations and "
            f"{duration(pc.mean(table['seconds']).as_py())} on one core",
            *dearest(table),
            *drawn_back(table),
            *skin_line(skin_figures),
        ],
        "judgement": [
            *failures(table.filter(pc.not_equal(table["status"], CONVERGED)), len(table)),
            *finding(overlap, metadata(table).get("length", np.inf)),
            *beyond_calibration(solved),
            *unfilled(solved),
            *without_effect(solved),
        ],
        "rows": {split: len(table) for split, table in tables.items()},
        "failed": failed,
        **costs,
        "residual_max": worst,
        "skin": skin_figures,
        "overlap": overlap,
    }


def dearest(table: pa.Table) -> list[str]:
    """Sentence on the state that took the most factorisations and why, where that is many times the mean."""
    counts = column_array(table, "factorizations")
    index = int(np.argmax(counts))
    if counts[index] < DEAR * counts.mean():
        return []
    row = table.slice(index, 1).to_pylist()[0]
    shares = ", ".join(f"{share:.2f}" for share in row["u"])
    ended = "converged" if row["status"] == CONVERGED else row["reason"]
    return [
        f"dearest state: row {row['id']} of {row['split']}, u = [{shares}], "
        f"{counted(row['factorizations'], 'factorisation')} in {counted(row['steps'], 'load step')}; {ended}"
    ]


def drawn_back(table: pa.Table) -> list[str]:
    """Line about the share of the reach to which all actuators are pulled at once, where the body bears less than their
    reach."""
    together = metadata(table).get("together", 1.0)
    what = f"all actuators at once are pulled to {100 * together:.0f} % of their reach, as more would buckle the body"
    return [what] if together < 1.0 else []


def skin_results(solved: pa.Table, skin: Skin) -> dict[str, Any]:
    """Results on the modes of the skin, and on how far they leave the surface of the converged rows from its place."""
    largest, rms = (column_array(solved, name) for name in ("skin_max", "skin_rms"))
    meta = metadata(solved)
    skin_spec = meta["plan"].get("skin") or {}
    tolerance = None if skin_spec.get("modes") else skin_spec.get("tolerance") or TOLERANCE * meta["length"]
    return {
        "modes": len(skin.modes),
        "nodes": len(skin.nodes),
        "tolerance_mm": tolerance,
        "left_out_mm": skin.front[len(skin.modes)].tolist(),
        "largest_mm": float(largest.max()),
        "rms_mm": float(np.sqrt(np.mean(rms**2))),
        "front_mm": skin.front.tolist(),
        "inner": {"nodes": len(skin.inner_nodes), "rms_mm": skin.inner_left[0], "largest_mm": skin.inner_left[1]}
        if len(skin.inner_nodes)
        else None,
    }


def beyond_calibration(solved: pa.Table) -> list[dict[str, Any]]:
    """Poor where forces are beyond those of the calibration that says what the model lacks."""
    meta = metadata(solved)
    lacks = (meta.get("robot") or {}).get("discrepancy")
    if not lacks:
        return []
    rows = rows_of(meta)
    units = [unit for _, unit in meta["row_units"][rows.a]]
    largest = [parse_quantity(lacks["largest"][name], unit) for name, unit in zip(rows.actuators, units, strict=True)]
    beyond = np.abs(column_array(solved, "lambda_a")) > BEYOND * np.array(largest)
    states = beyond.any(axis=1)
    if states.sum() <= FAILED_SHARE * len(states):
        return []
    limits = ", ".join(
        f"{name} {lacks['largest'][name]}" for name, far in zip(rows.actuators, beyond.any(axis=0), strict=True) if far
    )
    what = f"{states.sum()} of {len(states)} states have forces beyond the calibration's largest ({limits})"
    return [poor(f"{what}, where nothing tells what the model lacks: make the reach smaller")]


def unfilled(solved: pa.Table) -> list[dict[str, Any]]:
    """Poor where the states fill little of the reach of an actuator, of which no model knows the rest."""
    meta = metadata(solved)
    plan = meta.get("plan") or {}
    if "reach" not in meta or plan.get("contact") or plan.get("space") in ("rest", "force") or len(solved) < FEW:
        return []
    reach, delta_a = np.array(meta["reach"]), column_array(solved, "delta_a")
    width = reach[:, 1] - reach[:, 0]
    share = np.ptp(delta_a[:, : len(width)], axis=0) / np.where(width > 0, width, np.nan)
    if np.isnan(share).all() or np.nanmin(share) >= FILLED:
        return []
    worst, rows = int(np.nanargmin(share)), rows_of(meta)
    low, high = delta_a[:, worst].min(), delta_a[:, worst].max()
    name, (unit, _) = rows.actuators[worst], meta["row_units"][rows.a][worst]
    what = f"states of '{name}' lie between {low:.3g} and {high:.3g} {unit}, {100 * share[worst]:.0f} % of its reach"
    return [poor(f"{what}: draw from all of it by space: displacement, or state the reach that is used")]


def without_effect(solved: pa.Table) -> list[dict[str, Any]]:
    """Poor where a parameter has changed nothing in any state."""
    meta = metadata(solved)
    parameters, plan = sampled(from_json(meta.get("parameters", []))), meta.get("plan") or {}
    slopes = [name for name in ("dpsi_dp", "dlambda_dp", "ddelta_e_dp") if name in solved.column_names]
    if not parameters or not slopes or plan.get("space") == "rest":
        return []
    arrays = [column_array(solved, name).reshape(len(solved), -1, len(parameters)) for name in slopes]
    moves = np.any([np.abs(array).max(axis=(0, 1)) > 0 for array in arrays], axis=0)
    return [
        poor(f"parameter '{parameter.name}' ({parameter.key}) changes nothing in any state: leave it out")
        for parameter, has_effect in zip(parameters, moves, strict=True)
        if not (has_effect or is_of_motion(parameter.key))
    ]


def skin_line(skin: dict[str, Any] | None) -> list[str]:
    """Line about the modes of the skin."""
    if skin is None:
        return []
    modes = counted(skin["modes"], "mode describes", "modes describe")
    line = f"skin: {modes} the surface, with an error of {length(skin['largest_mm'])} at most"
    tolerance, reached = skin["tolerance_mm"], skin["left_out_mm"][1]
    if tolerance is None or reached <= tolerance:
        return [line]
    return [
        f"{line}; in states left out {length(reached)}, so the tolerance of {length(tolerance)} is NOT reached: "
        "allow more modes (skin.largest), or a larger skeleton"
    ]


def failures(failed: pa.Table, rows: int) -> list[dict[str, Any]]:
    """Findings about so many failed rows."""
    if len(failed) <= FAILED_SHARE * rows:
        return []
    why, _ = Counter(failed["reason"].to_pylist()).most_common(1)[0]
    share = f"{len(failed)} of {rows} states failed, {100 * len(failed) / rows:.0f} %"
    return [poor(f"{share}. The most frequent cause is: {why}. The reach may be more than the robot can do")]
