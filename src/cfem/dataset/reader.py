"""A Parquet file to arrays: converged rows as numbers, failed rows as a table with their reasons."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from cfem.condensed import Rows, unpack_upper
from cfem.condensed.parameters import Parameter, sampled
from cfem.core.errors import InputError
from cfem.core.reading import checked
from cfem.dataset.card import DatasetCard
from cfem.dataset.parquet import damaged, open_parquet
from cfem.dataset.schema import (
    COLUMNS,
    FORMAT,
    loads_of,
    metadata,
    metadata_of,
    parameters_of,
    rows_of,
    schema,
    without_skin,
)

CONVERGED = "converged"
LARGEST = 1e100  # of any number of a converged state: products of it still are numbers
_AGAIN = "sample it again with cfem sample --force"
COST = ("iterations", "factorizations", "steps", "residual", "tolerance", "seconds")


@dataclass(frozen=True)
class OfStates:
    """Numbers of m states. Every field that is an array has one entry a state along its first axis."""

    def take(self, index: np.ndarray | slice) -> Self:
        """States that `index` (numbers, a mask or a slice) picks, in its order."""

        def picked(value: Any) -> Any:
            if isinstance(value, OfStates):
                return value.take(index)
            return value[index] if isinstance(value, np.ndarray) else value

        return replace(self, **{field.name: picked(getattr(self, field.name)) for field in fields(self)})


@dataclass(frozen=True)
class Dataset(OfStates):
    """Converged states of one robot, m of them, in the order of their plan.

    id: (m,) number of the row in its plan
    u: (m, n_a + n_p) its place in the unit cube
    p: (m, n_p) values of the sampled parameters, no columns where there is none
    delta_a, lambda_a: (m, n_a) mm and N
    delta_e: (m, n_e) mm from the rest position
    W, delta_free: (m, n, n) mm/N and (m, n) mm in the order of `rows`
    energy: (m,) N mm
    slack: (m, n_a) actuators that carry nothing
    dW: (m, n_a, n, n) mm/N^2, dW/dlambda_k along the equilibrium path, None where it was not asked for
    dC: (m, n_e (n_e + 1) (n_e + 2) / 6) mm/N^2, packed derivative of the effectors' compliance, actuators held, by a
        wrench on them
    d2C: (m, n_e (n_e + 1) (n_e + 2) (n_e + 3) / 24) mm/N^3, the second derivative likewise
    dpsi_dp, dlambda_dp, ddelta_e_dp: (m, n_p) N mm, (m, n_a, n_p) N and (m, n_e, n_p) mm a unit of p, at constant
        delta_a; None without parameters
    cost: (m,) each of COST by name
    failed: the rows that did not converge, as stored
    meta: rest_e, reach, length, ...
    with_skin: the same states with the rows of the skin, `skin`; None where there is none
    moving: what the rows need to move, None where it was not asked for

    Where a rigid patch holds the contact points, the coordinates of its pose stand behind the actuators: a model takes
    both alike. `rows.actuators` names them all, n_c says how many the patch has, and delta_a, lambda_a (the wrench that
    holds it, N and N mm) and n_a include them."""

    rows: Rows
    id: np.ndarray
    u: np.ndarray
    p: np.ndarray
    delta_a: np.ndarray
    delta_e: np.ndarray
    lambda_a: np.ndarray
    W: np.ndarray
    delta_free: np.ndarray
    energy: np.ndarray
    slack: np.ndarray
    dW: np.ndarray | None
    dC: np.ndarray | None
    d2C: np.ndarray | None
    dpsi_dp: np.ndarray | None
    dlambda_dp: np.ndarray | None
    ddelta_e_dp: np.ndarray | None
    cost: dict[str, np.ndarray]
    failed: pa.Table
    meta: dict[str, Any]
    n_c: int = 0
    with_skin: "WithSkin | None" = None
    moving: "Moving | None" = None

    def __len__(self) -> int:
        return len(self.id)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The sampled ones, in the order of the columns of p."""
        return sampled(parameters_of(self.meta))

    def take(self, index: np.ndarray | slice) -> Self:
        """Dataset of the states that `index` picks, as of `OfStates.take`."""
        return replace(super().take(index), cost={name: values[index] for name, values in self.cost.items()})


@dataclass(frozen=True)
class WithSkin(OfStates):
    """Rows of the skin in a dataset of m states.

    rows: with n_s of the skin between effectors and actuators, of which there are n in all
    delta_s: (m, n_s) mm from rest
    W: (m, n, n)
    dW, ddelta_s_dp: (m, n_a, n, n) and (m, n_s, n_p), None where the dataset has none
    left: (m, 2) mm, root mean square and largest distance of the surface nodes from where the rows put them
    sha256: of the file of the modes"""

    rows: Rows
    delta_s: np.ndarray
    W: np.ndarray
    dW: np.ndarray | None
    ddelta_s_dp: np.ndarray | None
    left: np.ndarray
    sha256: str


@dataclass(frozen=True)
class Moving(OfStates):
    """Mass and viscosity of the motions of all n rows, the skin's included: `cfem.equilibrium.motion.inertia` says of
    which.

    rows: of all
    W, V, V2, V3: (m, n, n)
    loss: (m, k, 2 n, 2 n) of each viscous material
    dV: (m, n_a, n, n), None where the dataset has none
    viscosity: of each of these materials, its relaxation and prony
    inner_K, inner_M, inner_loss, inner_e: of inner motions instead of V2, V3 and loss, as `inertia.Inner` has them,
        where the robot has such"""

    rows: Rows
    W: np.ndarray
    V: np.ndarray
    V2: np.ndarray | None
    V3: np.ndarray | None
    loss: np.ndarray | None
    dV: np.ndarray | None
    viscosity: list[dict[str, Any]]
    inner_K: np.ndarray | None = None
    inner_M: np.ndarray | None = None
    inner_loss: np.ndarray | None = None
    inner_e: np.ndarray | None = None


def read_dataset(path: Path) -> Dataset:
    """Dataset from a file of `cfem sample`. Raises InputError naming the file where it is missing, damaged, or no
    dataset of cfem, and the column and the row where a converged state has no number or one beyond all sense."""
    table = read_table(path)
    _demand_numbers(table, path)
    return as_dataset(table)


def _demand_numbers(table: pa.Table, path: Path) -> None:
    """Raises InputError where a column holds what is no number, or a parameter leaves its range."""
    solved = table.filter(pc.equal(table["status"], CONVERGED))
    for column in COLUMNS:
        if column.name not in solved.column_names or pa.types.is_string(column.kind):
            continue
        stored = solved[column.name].combine_chunks()
        flat = stored.flatten() if column.size is not None else stored
        values = np.nan_to_num(flat.cast(pa.float64()).to_numpy(zero_copy_only=False), nan=np.inf, posinf=np.inf)
        wrong = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if stored.null_count or flat.null_count or len(wrong):
            row = int(wrong[0]) // (stored.type.list_size if column.size is not None else 1) if len(wrong) else 0
            what = f"is damaged: column '{column.name}', converged row {row}: is no number of at most {LARGEST:g}"
            raise InputError(what, where=str(path), do=_AGAIN)
    for index, parameter in enumerate(sampled(parameters_of(metadata(table)))):
        p = column_array(solved, "p")[:, index]
        slack = 1e-6 * (parameter.high - parameter.low)
        if len(p) and not (parameter.low - slack <= p.min() and p.max() <= parameter.high + slack):
            ends = f"{parameter.low:g} to {parameter.high:g}"
            what = f"is damaged: column 'p': parameter '{parameter.name}' leaves its range {ends}"
            raise InputError(what, where=str(path), do=_AGAIN)


def as_dataset(table: pa.Table) -> Dataset:
    """The converged rows of a table with the columns and metadata of a dataset."""
    meta = metadata(table)
    solved = pc.equal(table["status"], CONVERGED)
    good, stored = table.filter(solved), rows_of(meta)
    rows = Rows(stored.effectors, stored.actuators + stored.contacts)
    has = set(table.column_names)

    def active(name: str) -> np.ndarray:
        parts = [column_array(good, f"{name}_{block}") for block in ("a", "c") if f"{name}_{block}" in has]
        return np.hstack(parts)

    slack = column_array(good, "slack")
    p = column_array(good, "p") if "p" in has else np.zeros((len(good), 0))
    W = unpack_upper(column_array(good, "W"))
    triangles = (len(good), rows.n_a, stored.n * (stored.n + 1) // 2)
    dW = unpack_upper(column_array(good, "dW").reshape(triangles)) if "dW" in has else None
    no_skin = np.r_[stored.e, stored.active]  # all rows but the skin's
    return Dataset(
        rows=rows,
        **{name: column_array(good, name) for name in ("id", "u", "delta_e")},
        delta_free=column_array(good, "delta_free")[:, no_skin],
        delta_a=active("delta"),
        lambda_a=active("lambda"),
        p=p,
        W=W[:, no_skin[:, None], no_skin],
        dW=None if dW is None else dW[:, :, no_skin[:, None], no_skin],
        dC=column_array(good, "dC") if "dC" in has else None,
        d2C=column_array(good, "d2C") if "d2C" in has else None,
        dpsi_dp=column_array(good, "dpsi_dp") if "dpsi_dp" in has else None,
        dlambda_dp=_by_p(good, "dlambda_dp", p),
        ddelta_e_dp=_by_p(good, "ddelta_e_dp", p),
        energy=column_array(good, "energy"),
        slack=np.hstack([slack, np.zeros((len(good), stored.n_c), dtype=bool)]),
        n_c=stored.n_c,
        cost={name: column_array(good, name) for name in COST},
        failed=table.filter(pc.invert(solved)),
        meta=without_skin(meta),
        with_skin=_with_skin(good, meta, rows, W, dW, p) if stored.n_s else None,
        moving=_moving(good, meta, replace(rows, skin=stored.skin), W) if "V" in has else None,
    )


def _with_skin(
    good: pa.Table, meta: dict[str, Any], rows: Rows, W: np.ndarray, dW: np.ndarray | None, p: np.ndarray
) -> WithSkin:
    left = np.column_stack([column_array(good, name) for name in ("skin_rms", "skin_max")])
    rows = replace(rows, skin=rows_of(meta).skin)
    return WithSkin(rows, column_array(good, "delta_s"), W, dW, _by_p(good, "ddelta_s_dp", p), left, meta["skin"])


def _moving(good: pa.Table, meta: dict[str, Any], rows: Rows, W: np.ndarray) -> Moving:
    """Columns of motion of the converged rows."""
    has, m = set(good.column_names), len(good)
    V, viscosity, n = unpack_upper(column_array(good, "V")), meta["viscosity"], 2 * rows.n
    dV = unpack_upper(column_array(good, "dV").reshape(m, rows.n_a, -1)) if "dV" in has else None

    def forms(name: str, n: int) -> np.ndarray:
        if not viscosity:
            return np.zeros((m, 0, n, n))
        return unpack_upper(column_array(good, name).reshape(m, len(viscosity), n * (n + 1) // 2))

    if "inner_M" not in has:
        V2, V3 = (unpack_upper(column_array(good, name)) for name in ("V2", "V3"))
        return Moving(rows, W, V, V2, V3, forms("loss", n), dV, viscosity)
    K, M = (unpack_upper(column_array(good, name)) for name in ("inner_K", "inner_M"))
    e = column_array(good, "inner_e").reshape(m, rows.n_e, -1)
    return Moving(rows, W, V, None, None, None, dV, viscosity, K, M, forms("inner_loss", M.shape[1]), e)


def _by_p(good: pa.Table, name: str, p: np.ndarray) -> np.ndarray | None:
    return column_array(good, name).reshape(len(good), -1, p.shape[1]) if name in good.column_names else None


def read_table(path: Path) -> pa.Table:
    """The file as it is, its page checksums verified. Raises InputError."""
    file = open_parquet(path, _AGAIN)
    try:
        meta = metadata_of(file.schema_arrow)
        if not isinstance(meta, dict):
            raise ValueError("its metadata is not a JSON object")
    except (ValueError, RecursionError) as error:
        raise damaged(path, error, _AGAIN) from None
    if not meta:
        raise InputError(
            "is not a dataset of cfem: it has no metadata of one",
            where=str(path),
            do="give a file that cfem sample made",
        )
    if meta.get("format", FORMAT) != FORMAT:
        what = f"has format {str(meta['format'])[:50]}; this cfem reads {FORMAT}"
        raise InputError(what, where=str(path), do=_AGAIN)
    card = checked(DatasetCard, meta, f"{path}: metadata", _AGAIN)
    names = set(file.schema_arrow.names)
    units = [tuple(pair) for pair in card.row_units]
    moving = {"viscosity": meta["viscosity"], "inner": card.inner} if card.viscosity is not None else {}
    expected = schema(rows_of(meta), moving, parameters_of(meta), "dW" in names, units, loads_of(names))
    for field in expected:
        if field.name not in names:
            raise InputError(f"is damaged: column '{field.name}' is missing", where=str(path), do=_AGAIN)
        kind = file.schema_arrow.field(field.name).type
        if kind != field.type:
            what = f"is damaged: column '{field.name}' is of type {kind}, expected {field.type}"
            raise InputError(what, where=str(path), do=_AGAIN)
    if len(file.schema_arrow.names) != len(expected.names):
        strange = sorted(names - set(expected.names)) or ["twice"]
        raise InputError(f"is damaged: unknown column '{strange[0]}'", where=str(path), do=_AGAIN)
    try:
        return file.read().replace_schema_metadata(file.schema_arrow.metadata)
    except (OSError, ValueError, MemoryError, pa.ArrowException) as error:
        raise damaged(path, error, _AGAIN) from None


def column_array(table: pa.Table, name: str) -> np.ndarray:
    """Values (m,) or (m, size of the list) of a column without nulls."""
    column = table[name].combine_chunks()
    if pa.types.is_fixed_size_list(column.type):
        return column.flatten().to_numpy(zero_copy_only=False).reshape(len(column), column.type.list_size)
    return column.to_numpy(zero_copy_only=False)
