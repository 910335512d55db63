"""The columns of a dataset: names, types, units, and the metadata that makes a file speak for itself."""

import json
from collections.abc import Container, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from math import comb
from typing import Any

import numpy as np
import pyarrow as pa

from cfem.condensed import Rows
from cfem.condensed.packing import packed_indices
from cfem.condensed.parameters import Parameter, from_json, sampled, to_json

FORMAT = 3
KEY = b"cfem"
SKIN = "skin.npz"  # beside the rows: see cfem.condensed.skin
CABLE = ("mm", "N")
# What made the numbers, not what they are: left out of the content hash.
_PROVENANCE = ("versions", "made_from")


@dataclass(frozen=True)
class Column:
    """Column of a dataset.

    unit: of every number in it, '' for text and counts, '1' for ratios; of rows, that of a cable's, see `_units`
    size: which numbers, None for a scalar
    state: True where a row whose solve failed has no value"""

    name: str
    kind: pa.DataType
    unit: str = ""
    size: str | None = None
    state: bool = False


_F, _N, _S = pa.float64(), pa.int64(), pa.string()
COLUMNS = (
    Column("id", _N),
    Column("split", _S),
    Column("status", _S),
    Column("reason", _S),
    Column("u", _F, "1", "plan"),
    Column("p", _F, "", "parameters"),
    Column("delta_a", _F, "mm", "actuators", state=True),
    Column("delta_e", _F, "mm", "effectors", state=True),
    Column("delta_s", _F, "mm", "skin", state=True),
    Column("lambda_a", _F, "N", "actuators", state=True),
    Column("delta_c", _F, "mm", "contacts", state=True),
    Column("lambda_c", _F, "N", "contacts", state=True),
    Column("W", _F, "mm/N", "upper triangle", state=True),
    Column("delta_free", _F, "mm", "rows", state=True),
    Column("energy", _F, "N mm", state=True),
    Column("dW", _F, "mm/N^2", "active x upper triangle", state=True),
    Column("dC", _F, "mm/N^2", "effectors cubed", state=True),
    Column("d2C", _F, "mm/N^3", "effectors to the fourth", state=True),
    Column("V", _F, "mm/N s^2", "upper triangle", state=True),
    Column("V2", _F, "mm/N s^4", "upper triangle", state=True),
    Column("V3", _F, "mm/N s^6", "upper triangle", state=True),
    Column("loss", _F, "", "viscous x twice the rows", state=True),
    Column("inner_K", _F, "N mm", "inner upper triangle", state=True),
    Column("inner_M", _F, "", "moving upper triangle", state=True),
    Column("inner_loss", _F, "", "viscous x moving upper triangle", state=True),
    Column("inner_e", _F, "mm", "effectors x inner", state=True),
    Column("dV", _F, "mm/N^2 s^2", "active x upper triangle", state=True),
    Column("dpsi_dp", _F, "N mm", "parameters", state=True),
    Column("dlambda_dp", _F, "N", "actuators x parameters", state=True),
    Column("ddelta_e_dp", _F, "mm", "effectors x parameters", state=True),
    Column("ddelta_s_dp", _F, "mm", "skin x parameters", state=True),
    Column("skin_rms", _F, "mm", state=True),
    Column("skin_max", _F, "mm", state=True),
    Column("slack", pa.bool_(), "", "actuators", state=True),
    Column("iterations", _N),
    Column("factorizations", _N),
    Column("steps", _N),
    Column("residual", _F, "1"),
    Column("tolerance", _F, "1"),
    Column("seconds", _F, "s"),
)
BY_PARAMETERS = frozenset(("p", "dpsi_dp", "dlambda_dp", "ddelta_e_dp"))  # all or none
MOVING = frozenset(("V2", "V3"))  # beside V, unless there are inner motions
INNER = frozenset(("inner_K", "inner_M", "inner_e"))
OF_SKIN = frozenset(("delta_s", "skin_rms", "skin_max"))  # all or none


def schema(
    rows: Rows,
    meta: dict[str, Any],
    parameters: Sequence[Parameter] = (),
    third_order: bool = False,
    row_units: Sequence[tuple[str, str]] = (),
    loads: int = 0,
) -> pa.Schema:
    """Arrow schema of a robot's dataset; lists have a fixed size.

    meta: plain JSON data for the file's key 'cfem', beside the format's version, the names and units of the rows, the
        parameters and the unit of each column; with "viscosity" (of each viscous material) there are the columns of
        motion, and "inner" is the number of inner motions
    parameters: sampled and exact ones
    third_order: whether it has dW
    loads: whether it has dC, and d2C from 2 on
    row_units: of each row's displacement and multiplier, mm and N unless given"""
    varied, k, viscous = sampled(parameters), meta.get("inner") or 0, len(meta.get("viscosity") or ())
    sizes = _sizes(rows, len(varied), k, viscous)
    present = dict.fromkeys(BY_PARAMETERS, bool(varied)) | {"dW": third_order, "dC": loads > 0, "d2C": loads > 1}
    moving = meta.get("viscosity") is not None
    present |= dict.fromkeys(MOVING, moving and not k) | dict.fromkeys(INNER, k > 0)
    present |= {"V": moving, "dV": moving and third_order}
    present |= {"loss": bool(meta.get("viscosity")) and not k, "inner_loss": bool(meta.get("viscosity")) and k > 0}
    present |= {"delta_c": rows.n_c > 0, "lambda_c": rows.n_c > 0}
    present |= dict.fromkeys(OF_SKIN, rows.n_s > 0) | {"ddelta_s_dp": bool(varied) and rows.n_s > 0}
    columns = [column for column in COLUMNS if present.get(column.name, True)]
    fields = [
        pa.field(
            column.name, column.kind if column.size is None else pa.list_(column.kind, sizes[column.size]), column.state
        )
        for column in columns
    ]
    row_units = list(row_units) or [CABLE] * rows.n
    facts = {
        "format": FORMAT,
        "rows": asdict(rows),
        "row_units": [list(pair) for pair in row_units],
        "parameters": to_json(parameters),
        "units": _units(columns, rows, row_units, [parameter.unit for parameter in varied], viscous, k),
    }
    return pa.schema(fields, metadata={KEY: json.dumps({**meta, **facts}, sort_keys=True, allow_nan=False).encode()})


def _sizes(rows: Rows, n_p: int, k: int, viscous: int) -> dict[str, int]:
    """Lengths of the lists in columns; n_p: sampled parameters; k: inner motions; viscous: number of materials."""
    triangle = rows.n * (rows.n + 1) // 2
    moved = (rows.n_a + k) * (rows.n_a + k + 1) // 2
    return {
        "plan": rows.n_a + rows.n_c + n_p,
        "parameters": n_p,
        "actuators": rows.n_a,
        "effectors": rows.n_e,
        "effectors cubed": comb(rows.n_e + 2, 3),
        "effectors to the fourth": comb(rows.n_e + 3, 4),
        "skin": rows.n_s,
        "contacts": rows.n_c,
        "rows": rows.n,
        "upper triangle": triangle,
        "active x upper triangle": (rows.n_a + rows.n_c) * triangle,
        "inner upper triangle": k * (k + 1) // 2,
        "moving upper triangle": moved,
        "viscous x moving upper triangle": viscous * moved,
        "effectors x inner": rows.n_e * k,
        "viscous x twice the rows": viscous * rows.n * (2 * rows.n + 1),
        "actuators x parameters": rows.n_a * n_p,
        "effectors x parameters": rows.n_e * n_p,
        "skin x parameters": rows.n_s * n_p,
    }


def with_skin_rows(plain: pa.Schema, names: Sequence[str], sha256: str) -> pa.Schema:
    """The schema with the rows of a skin, of which the metadata then have the SHA-256 of its file."""
    meta = metadata_of(plain)
    rows = replace(rows_of(meta), skin=tuple(names))
    units = [tuple(pair) for pair in meta["row_units"]]
    units[rows.n_e : rows.n_e] = [CABLE] * rows.n_s
    return schema(
        rows, {**meta, "skin": sha256}, parameters_of(meta), "dW" in plain.names, units, loads_of(plain.names)
    )


def without_skin(meta: dict[str, Any]) -> dict[str, Any]:
    """Metadata of the dataset, had it no skin."""
    rows = rows_of(meta)
    if not rows.n_s:
        return meta
    units = [tuple(pair) for pair in meta["row_units"]]
    del units[rows.s]
    known = {key: value for key, value in meta.items() if key != "skin"}
    plain = schema(
        replace(rows, skin=()), known, parameters_of(meta), "dW" in meta["units"], units, loads_of(meta["units"])
    )
    return metadata_of(plain)


def _units(
    columns: Sequence[Column],
    rows: Rows,
    row_units: Sequence[tuple[str, str]],
    parameters: Sequence[str],
    viscous: int = 0,
    inner: int = 0,
) -> dict[str, str | list[str]]:
    """Units by column: of all its numbers, or a list of each one's where they differ. An entry (i, j) of W has the
    displacement unit of row i over the multiplier unit of row j."""
    units: dict[str, str | list[str]] = {column.name: column.unit for column in columns if column.unit}
    displacement, multiplier = ([pair[side] for pair in row_units] for side in (0, 1))
    if set(row_units) != {CABLE}:
        by_column = _units_of_rows(rows, displacement, multiplier)
        units |= {
            name: list_of_units[0] if len(set(list_of_units)) == 1 else list_of_units
            for name, list_of_units in by_column.items()
            if name in units
        }
    if inner:
        moving = [*(f"/{_factor(unit)}" for unit in displacement[rows.a]), *[""] * inner]
        pairs = [moving[i] + moving[j] for i in range(len(moving)) for j in range(i, len(moving))]
        units["inner_M"] = [f"N mm s^2{pair}" for pair in pairs]
        if viscous:
            units["inner_loss"] = [f"N mm{pair}" for pair in pairs] * viscous
    elif viscous:
        motions = [(row, power) for power in (0, 2) for row in range(rows.n)]  # motions Z, then Y
        pairs = [(first, second) for i, first in enumerate(motions) for second in motions[i:]]
        form = [
            f"{displacement[i]}/{_factor(multiplier[j])}" + (f" s^{p + q}" if p + q else "") for (i, p), (j, q) in pairs
        ]
        units["loss"] = form * viscous
    if parameters:
        units["p"] = list(parameters)
        per = ["" if unit == "1" else f"/{_factor(unit)}" for unit in parameters]
        units["dpsi_dp"] = [f"N mm{by}" for by in per]
        units["dlambda_dp"] = [f"{unit}{by}" for unit in multiplier[rows.a] for by in per]
        units["ddelta_e_dp"] = [f"{unit}{by}" for unit in displacement[rows.e] for by in per]
        if rows.n_s:
            units["ddelta_s_dp"] = [f"{unit}{by}" for unit in displacement[rows.s] for by in per]
    return units


def _units_of_rows(rows: Rows, displacement: Sequence[str], multiplier: Sequence[str]) -> dict[str, list[str]]:
    """Unit of every number of the columns about rows, by column."""
    per = [_factor(unit) for unit in multiplier]
    upper = [f"{displacement[i]}/{per[j]}" for i in range(rows.n) for j in range(i, rows.n)]
    return {
        "delta_a": displacement[rows.a],
        "delta_e": displacement[rows.e],
        "lambda_a": multiplier[rows.a],
        "delta_c": displacement[rows.c],
        "lambda_c": multiplier[rows.c],
        "delta_free": displacement,
        "W": upper,
        **{name: [f"{unit} s^{2 * power}" for unit in upper] for power, name in enumerate(("V", "V2", "V3"), 1)},
        "dV": [f"{unit}/{k} s^2" for k in per[rows.active] for unit in upper],
        "dW": [f"{unit}/{k}" for k in per[rows.active] for unit in upper],
        "dC": _quotients(packed_indices(rows.n_e, 3), displacement, multiplier),
        "d2C": _quotients(packed_indices(rows.n_e, 4), displacement, multiplier),
    }


def _quotients(entries: np.ndarray, displacement: Sequence[str], multiplier: Sequence[str]) -> list[str]:
    """Units of the entries (k, m) of a derivative by loads."""
    per = [_factor(unit) for unit in multiplier]
    return ["/".join([displacement[first], *(per[index] for index in further)]) for first, *further in entries.T]


def loads_of(names: Container[str]) -> int:
    """Number of derivatives of the compliance by loads that the columns have."""
    return int("dC" in names) + int("d2C" in names)


def _factor(unit: str) -> str:
    """Unit as it stands in a denominator."""
    return f"({unit})" if " " in unit or "/" in unit else unit


def metadata(table: pa.Table) -> dict[str, Any]:
    """Metadata that `schema` put into a file; empty in a file of others. Raises ValueError where it is damaged."""
    return metadata_of(table.schema)


def metadata_of(schema: pa.Schema) -> dict[str, Any]:
    """Metadata that `metadata` put into a schema."""
    return json.loads((schema.metadata or {}).get(KEY, b"{}"))


def rows_of(meta: dict[str, Any]) -> Rows:
    return Rows(**{block: tuple(names) for block, names in meta["rows"].items()})


def parameters_of(meta: dict[str, Any]) -> tuple[Parameter, ...]:
    """Sampled and exact ones."""
    return from_json(meta["parameters"])


def content(table: pa.Table) -> Iterator[bytes]:
    """Bytes of all that identifies a dataset: meaning and values, without the time it took and what made it. Of each
    column its name, type and length, which rows have a value, and these values."""
    meta = {key: value for key, value in metadata(table).items() if key not in _PROVENANCE}
    yield json.dumps(meta, sort_keys=True).encode()
    for name in sorted(set(table.column_names) - {"seconds"}):
        column = table[name].combine_chunks()
        yield json.dumps([name, str(column.type), len(column)]).encode()
        yield column.is_valid().to_numpy(zero_copy_only=False).tobytes()
        values = column.drop_null()
        if pa.types.is_fixed_size_list(values.type):
            values = values.flatten()
        if pa.types.is_string(values.type):
            yield json.dumps(values.to_pylist()).encode()
        else:
            numbers = values.to_numpy(zero_copy_only=False)
            yield numbers.astype(numbers.dtype.newbyteorder("<"), copy=False).tobytes()
