"""The step in time in C: cfem_motion.c, the same for every robot, and its numbers, cfem_motion_data.c."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.export.firmware import c_text
from cfem.export.firmware.copying import copy_sources
from cfem.motion.model import layout

WIDE = 8  # as CFEM_SERIES_WIDE


def write_c_motion(folder: Path, meta: dict[str, Any], arrays: dict[str, np.ndarray], moving: dict[str, Any]) -> int:
    """Adds to a folder that holds the controller (`cfem.export.firmware.folder.write_c`); the bytes of the constants.
    meta, arrays: of a spectral model; moving: of its motion.npz. InputError where the model is of another kind."""
    if meta["kind"] != "spectral" or meta["form"] != "displacement":
        raise InputError("only spectral models of form displacement move in C", do="train kind: spectral")
    copy_sources(folder, "motion")
    sizes, constants, series = motion_constants(meta, moving)
    heading = c_text.comment(f"{meta['scene']} in motion: by cfem. Units: mm, N, s, t.")
    words = {f"CFEM_MOTION_{name}": value for name, value in sizes.items()}
    words["cfem_motion_stiffness"] = float(moving["stiffness"])
    body = ['#include "cfem_series.h"\n\n']
    for name, parts in series.items():
        body += [part.text(f"{name}_{index}") for index, part in enumerate(parts)]
        named = [part.name(f"{name}_{index}") for index, part in enumerate(parts)]
        body.append(f"const cfem_motion_series cfem_motion_{name}[] = {{{', '.join(named)}}};\n\n")
    file = folder / "cfem_motion_data"
    size = c_text.write_constants(file, heading, words, "cfem_motion_", constants, defined="".join(body))
    return size + sum(part.bytes for parts in series.values() for part in parts)


@dataclass(frozen=True)
class PackedSeries:
    """A series as cfem_series.h has it. first, end (groups,), second (terms,), coefficients (blocks, terms, WIDE)."""

    first: np.ndarray
    end: np.ndarray
    second: np.ndarray
    coefficients: np.ndarray

    @property
    def bytes(self) -> int:
        return self.coefficients.nbytes + self.first.nbytes + self.end.nbytes + self.second.nbytes

    def text(self, name: str) -> str:
        indices = [("first", self.first), ("end", self.end), ("second", self.second)]
        arrays = [c_text.array(f"{name}_{key}", values, "uint16_t")[1] for key, values in indices]
        arrays.append(c_text.array(name, self.coefficients.ravel(), "double")[1])
        return "".join(f"static {definition}\n" for definition in arrays)

    def name(self, name: str) -> str:
        return f"{{{len(self.first)}, {len(self.second)}, {name}_first, {name}_end, {name}_second, {name}}}"


def motion_constants(
    meta: dict[str, Any], moving: dict[str, Any]
) -> tuple[dict[str, int], dict[str, np.ndarray], dict[str, list[PackedSeries]]]:
    """Sizes, arrays and series by name: root, inner, loss (of each viscous material) and curve. Terms whose
    coefficients are all 0 are left out."""
    n_a, n_e, n_q = len(moving["to_box"]), len(meta["rows"]["effectors"]), len(moving["scale"])
    viscosity = meta["motion"]["viscosity"]
    where = layout(n_q, n_q - n_a, n_e, len(viscosity))
    prony = np.array([pair for material in viscosity for pair in material["prony"]], dtype=float).reshape(-1, 2)
    counts = np.array([len(material["prony"]) for material in viscosity], dtype=np.int32)
    constants = {name: np.asarray(moving[name], float) for name in ("to_box", "offset", "scale")}
    constants["unit"] = 1 / constants["scale"]
    constants["relaxation"] = np.array([material["relaxation"] for material in viscosity] or [0.0], dtype=float)
    constants["prony_terms"] = counts if len(counts) else np.zeros(1, dtype=np.int32)
    constants["prony"] = prony if len(prony) else np.ones((1, 2))
    named = {"root": [moving["series"][where["M"]]], "inner": [moving["series"][where["H"]]]}
    none = [np.zeros((1, len(moving["indices"])))]
    named["loss"] = [moving["series"][where[f"F{index}"]] for index in range(len(viscosity))] or none
    named["curve"] = [moving["curve"]] if "curve" in moving else none
    kept = np.flatnonzero(np.concatenate([part for parts in named.values() for part in parts]).any(axis=0))
    indices = moving["indices"][kept if len(kept) else [0]]
    half = (n_a + 1) // 2
    first, of_first = np.unique(indices[:, :half], axis=0, return_inverse=True)
    second, of_second = np.unique(indices[:, half:], axis=0, return_inverse=True)
    constants["first_degrees"] = first.astype(np.uint8).ravel()
    constants["second_degrees"] = np.append(second.astype(np.uint8).ravel(), np.uint8(0))  # none of one actuator
    series = {
        name: [_part(part[:, kept if len(kept) else [0]], of_first.ravel(), of_second.ravel()) for part in parts]
        for name, parts in named.items()
    }
    sizes = {"NA": n_a, "NQ": n_q, "NE": n_e, "LOSSES": len(viscosity), "TERMS": len(prony)}
    sizes |= {"CURVED": int("curve" in moving), "DEGREE": max(int(indices.max(initial=0)), 1)}
    sizes |= {"FIRST_PRODUCTS": len(first), "SECOND_PRODUCTS": len(second), "PRODUCTS": max(len(first), len(second))}
    return sizes, constants, series


def _part(series: np.ndarray, of_first: np.ndarray, of_second: np.ndarray) -> PackedSeries:
    """Series (outputs, M) in the order of its products. of_first, of_second: (M,) the products of each term."""
    kept = np.flatnonzero((series != 0).any(axis=0))
    kept = kept if len(kept) else np.zeros(1, dtype=int)
    kept = kept[np.lexsort([of_second[kept], of_first[kept]])]
    first, counts = np.unique(of_first[kept], return_counts=True)
    padded = np.zeros((len(kept), -(-len(series) // WIDE) * WIDE))
    padded[:, : len(series)] = series[:, kept].T
    coefficients = np.ascontiguousarray(padded.reshape(len(kept), -1, WIDE).swapaxes(0, 1))
    indices = (array.astype(np.uint16) for array in (first, np.cumsum(counts), of_second[kept]))
    return PackedSeries(*indices, coefficients)
