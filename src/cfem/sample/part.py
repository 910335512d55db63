"""One of n machines' share of a dataset, and all shares put together.

Every machine solves the skeleton, then every n-th shard. As a row depends on the skeleton and on its own shard alone,
the whole is what one machine would have made, digit for digit where all round alike."""

import re
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError, SpecError
from cfem.dataset.reader import read_table
from cfem.dataset.schema import SKIN, content
from cfem.dataset.writer import content_hash, write_table
from cfem.sample.artefact import keep_skin, kept_skin, results
from cfem.sample.overlap import read_overlap
from cfem.sample.plan import shards, skeleton
from cfem.sample.processes.pool import with_workers
from cfem.sample.processes.workers import Workers
from cfem.sample.runner import make_job, merge, solve_rows, solve_skeleton
from cfem.sample.solver import SolverFactory
from cfem.sample.spec import SampleSpec

SKELETON = "skeleton.parquet"


@dataclass(frozen=True)
class SamplePart:
    """A part of a sample that is solved elsewhere. index: from 1 to count."""

    index: int
    count: int

    def folder(self, dataset: Path) -> Path:
        """Folder of the part unless another is stated: beside the whole dataset."""
        return dataset.with_name(f"{dataset.name}-part-{self.index}-of-{self.count}")


def parse_part(text: str) -> SamplePart:
    """Part of a text such as '2/8'. Raises SpecError."""
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
    part = SamplePart(*map(int, match.groups())) if match else None
    if part is None or not 1 <= part.index <= part.count:
        raise SpecError(f"'{text}' is not a part i/n with 1 <= i <= n", where="--shard", do="use e.g. --shard 2/8")
    return part


def fill_part(
    folder: Path, spec: SampleSpec, factory: SolverFactory, made_from: str, part: SamplePart, workers: Workers
) -> dict[str, Any]:
    """Solves the skeleton and the part's shards into `folder`; returns results for the manifest. whole: what the
    complete dataset is made from."""
    begin = time.perf_counter()

    def solve(executor: Executor) -> int:
        job = make_job(spec, factory, folder, executor, made_from, workers.timeout)
        first = skeleton(job.u, spec.skeleton)
        rest = np.setdiff1d(np.arange(len(job.u)), first)
        share = slice(part.index - 1, None, part.count)
        job = solve_skeleton(job, first)
        solve_rows(job, rest, spec.shard, share)
        return sum(len(piece) for piece in shards(job.u, rest, spec.shard)[share])

    rows = with_workers(workers, solve)
    return {"part": vars(part) | {"of": made_from}, "rows": rows, "wall_seconds": time.perf_counter() - begin}


def fill_merged(folder: Path, spec: SampleSpec, parts: Sequence[Path], made_from: str) -> dict[str, Any]:
    """Writes one Parquet file a split from complete parts; returns results for the manifest. Raises InputError where a
    part is missing, damaged, twice there, or of another dataset."""
    manifests = _check_parts(parts, made_from)
    skeletons = [artefact_file(part, SKELETON) for part in parts]
    for part in (part for part, manifest in zip(parts, manifests, strict=True) if SKIN in manifest["files"]):
        artefact_file(part, SKIN)
    _demand_one_skeleton(skeletons)
    shards = [
        artefact_file(part, name)
        for part, manifest in zip(parts, manifests, strict=True)
        for name in manifest["files"]
        if name.startswith("shard-")
    ]
    tables = merge([skeletons[0], *shards], list(spec.splits))
    for split, table in tables.items():
        if table["id"].to_pylist() != list(range(spec.splits[split].rows)):
            raise InputError(f"the parts lack rows of '{split}'", where="merge", do="run the parts again with --force")
        write_table(folder / f"{split}.parquet", table)
    keep_skin(parts[0], folder)
    wall = max(manifest["results"]["wall_seconds"] for manifest in manifests)
    return {
        **results(tables, kept_skin(folder), read_overlap(parts[0])),
        "parts": len(parts),
        "wall_seconds": wall,
        "content": content_hash(tables),
    }


def _check_parts(parts: Sequence[Path], made_from: str) -> list[dict[str, Any]]:
    """Manifests of the parts."""
    manifests = [read_manifest(part) for part in parts]
    seen: dict[int, Path] = {}
    count = 0
    for folder, manifest in zip(parts, manifests, strict=True):
        part = manifest.get("results", {}).get("part")
        if not part:
            raise InputError("is not a part of a dataset", where=str(folder), do="make it with sample --shard")
        if part["of"] != made_from:
            do = "run sample --shard with the same spec, scene and mesh everywhere"
            raise InputError("is part of another dataset", where=str(folder), do=do)
        count = count or part["count"]
        if part["count"] != count:
            raise InputError(f"is one of {part['count']} parts, but others are of {count}", where=str(folder))
        if part["index"] in seen:
            raise InputError(f"is part {part['index']}, and so is {seen[part['index']]}", where=str(folder))
        seen[part["index"]] = folder
    missing = sorted(set(range(1, count + 1)) - set(seen))
    if missing:
        named = ", ".join(f"{index}/{count}" for index in missing[:5])
        do = f"run sample --shard {missing[0]}/{count}"
        raise InputError(f"{len(missing)} of {count} parts missing: {named}", where="merge", do=do)
    return manifests


def _demand_one_skeleton(files: Sequence[Path]) -> None:
    """Raises InputError where a skeleton has other digits than the first."""
    first = list(content(read_table(files[0])))
    for file in files[1:]:
        if list(content(read_table(file))) != first:
            what = f"was solved from other digits than {files[0]}: the machines round differently"
            raise InputError(what, where=str(file), do="use machines of one type and the same package versions")


def dataset_parts(dataset: Path) -> list[Path]:
    """Folders of parts beside a dataset. Raises InputError where there is none."""
    folders = sorted(dataset.parent.glob(f"{dataset.name}-part-*-of-*"))
    if not folders:
        raise InputError("has no parts beside it", where=str(dataset), do="run sample --shard i/n, or name them")
    return folders
