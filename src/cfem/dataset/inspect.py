"""A dataset in words: what is in it, in which units, and what it cost."""

from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cfem.condensed.parameters import sampled
from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.manifest import read_manifest
from cfem.core.console.shown import counted, duration
from cfem.core.errors import InputError
from cfem.dataset.reader import CONVERGED, column_array, read_table
from cfem.dataset.schema import COLUMNS, metadata, parameters_of, rows_of


def describe(path: Path) -> str:
    """Text for a terminal, of a dataset folder or of one of its files. Raises InputError."""
    table = pa.concat_tables([read_table(file) for file in dataset_files(path)], promote_options="none")
    solved = table.filter(pc.equal(table["status"], CONVERGED))
    return "\n\n".join([_heading(table), _counts(table), _statistics(solved), _cost(table)])


def dataset_files(path: Path) -> list[Path]:
    """The Parquet files of a dataset folder, each checked against the manifest; a file stands for itself."""
    if not path.is_dir():
        return [path]
    names = [name for name in read_manifest(path)["files"] if name.endswith(".parquet")]
    if not names:
        raise InputError("holds no dataset", where=str(path), do="give the folder that cfem sample made")
    return [artefact_file(path, name) for name in names]


def _heading(table: pa.Table) -> str:
    """Lines on the robot, its rows and its parameters."""
    meta = metadata(table)
    rows, units = meta["rows"], meta["units"]["delta_a"]
    units = [units] * len(meta["reach"]) if isinstance(units, str) else units
    reach = [f"{low:g} to {high:g} {unit}" for (low, high), unit in zip(meta["reach"], units, strict=False)]
    lines = [
        f"dataset of {meta['scene']}: {counted(len(table), 'state')}",
        f"effectors  {', '.join(rows['effectors'])}   at rest {np.round(meta['rest_e'], 6).tolist()} mm",
        f"actuators  {', '.join(rows['actuators'])}   reach {', '.join(reach)}",
        "rows of W  effectors, then actuators; upper triangle, row by row",
        "columns    u: the plan, from 0 to 1; delta: displacements; lambda: forces; delta_s: how far each mode of the",
        "           surface goes; skin_rms, skin_max: what the modes leave of the surface",
    ]
    for parameter in parameters_of(meta):
        how = (
            "exact, not sampled"
            if parameter.exact
            else f"drawn evenly in {parameter.coordinate.replace('p', parameter.name)}"
        )
        unit = parameter.suffix
        ends = f"{parameter.low:g} to {parameter.high:g}{unit}, {parameter.reference:g}{unit} in the scene"
        lines.append(f"parameter  {parameter.name} ({parameter.key}): {ends}; {how}")
    return "\n".join(lines)


def _counts(table: pa.Table) -> str:
    """Rows a split and status, and the reasons of those that failed."""
    count = Counter(
        zip(table["split"].to_pylist(), table["status"].to_pylist(), table["reason"].to_pylist(), strict=True)
    )
    lines = [f"{'split':<10} {'status':<22} {'rows':>6}"]
    lines += [
        f"{split:<10} {status:<22} {number:>6}{f'  {reason}' if reason else ''}"
        for (split, status, reason), number in sorted(count.items())
    ]
    return "\n".join(lines)


def _statistics(solved: pa.Table) -> str:
    """Table of the least, mean and largest value of every number of the converged rows; of W and dW over all their
    entries."""
    meta = metadata(solved)
    rows, varied = rows_of(meta), [parameter.name for parameter in sampled(parameters_of(meta))]
    names = {"actuators": rows.actuators, "effectors": rows.effectors, "rows": rows.names, "parameters": varied}
    names["plan"] = [*rows.actuators, *varied]
    lines = [f"{'column':<12} {'row':<12} {'unit':<7} {'min':>12} {'mean':>12} {'max':>12}"]
    for column in COLUMNS:
        stored = column.name in solved.column_names and column.name != "id"
        if not stored or pa.types.is_string(column.kind) or len(solved) == 0:
            continue
        values = column_array(solved, column.name).astype(float)
        unit = meta["units"].get(column.name, "")
        if column.size not in names:
            lines.append(_line(column.name, "", _unit(unit), values))
            continue
        units = unit if isinstance(unit, list) else [unit] * values.shape[1]
        lines += [_line(column.name, *entry) for entry in zip(names[column.size], units, values.T, strict=True)]
    return "\n".join(lines)


def _line(column: str, row: str, unit: str, values: np.ndarray) -> str:
    numbers = "".join(f" {number:>12.5g}" for number in (values.min(), values.mean(), values.max()))
    return f"{column:<12} {row:<12} {unit:<7}{numbers}"


def _unit(unit: str | list[str]) -> str:
    return unit if isinstance(unit, str) else f"({', '.join(dict.fromkeys(unit))})"


def _cost(table: pa.Table) -> str:
    factorizations, iterations, _ = cost(table).values()
    seconds = column_array(table, "seconds").mean()
    return (
        f"per state: {factorizations:.2f} factorisations, {iterations:.2f} iterations, {duration(seconds)} on one core"
    )


def cost(table: pa.Table) -> dict[str, float]:
    """Means over all rows, failed ones included: their cost was paid too."""
    seconds = column_array(table, "seconds").sum()
    return {
        "factorizations_per_sample": float(column_array(table, "factorizations").mean()),
        "iterations_per_sample": float(column_array(table, "iterations").mean()),
        "samples_per_second_per_core": float(len(table) / seconds) if seconds > 0 else 0.0,
    }
