"""The synthetic robot as artefact folders: a dataset, and models trained from it."""

from pathlib import Path
from typing import Any

import pyarrow as pa
from surrogate.synthetic import at_rest, dataset

from cfem.condensed import pack_upper
from cfem.condensed.parameters import from_json
from cfem.core.artefact.files import content_sha256, file_sha256, write_json, write_npz
from cfem.core.stage import Options
from cfem.dataset.schema import schema
from cfem.dataset.writer import write_table
from cfem.surrogate.stage import run


def store_dataset(
    folder: Path,
    n_a: int = 2,
    train: int = 40,
    test: int = 20,
    test_seed: int = 2,
    parameters: bool = False,
    rest: bool = False,
) -> Path:
    """Writes train.parquet, test.parquet and the manifest. rest: of the robots with their actuators free."""
    by_p = ("p", "dpsi_dp", "dlambda_dp", "ddelta_e_dp")
    for split, count, seed in (("train", train, 1), ("test", test, test_seed)):
        states = dataset(count, seed, n_a, unilateral=n_a == 2, parameters=parameters)
        states = at_rest(states) if rest else states
        counts = dict(
            status="converged",
            reason="",
            iterations=1,
            factorizations=1,
            steps=1,
            residual=0.0,
            tolerance=1e-10,
            seconds=0.1,
        )
        records = [
            {
                "id": i,
                "split": split,
                "u": states.u[i],
                "W": pack_upper(states.W[i]),
                "slack": [False] * n_a,
                **{
                    name: getattr(states, name)[i]
                    for name in ("delta_a", "delta_e", "lambda_a", "delta_free", "energy")
                },
                **({name: getattr(states, name)[i].ravel() for name in by_p} if parameters else {}),
                **counts,
            }
            for i in range(count)
        ]
        meta = {key: value for key, value in states.meta.items() if key not in ("units", "row_units", "parameters")}
        meta |= {"plan": {"space": "rest"}} if rest else {}
        varied = from_json(states.meta["parameters"])
        table = pa.Table.from_pylist(records, schema=schema(states.rows, meta, varied))
        write_table(folder / f"{split}.parquet", table)
    files = {path.name: file_sha256(path) for path in folder.glob("*.parquet")}
    write_json(
        folder / "manifest.json",
        {"stage": "sample", "content": content_sha256(files), "files": files},
    )
    return folder


def write_model(folder: Path, meta: dict[str, Any], arrays: dict[str, Any]) -> Path:
    """A model in memory as `cfem train` leaves it."""
    write_json(folder / "model.json", {"history": [], **meta})
    write_npz(folder / "weights.npz", arrays)
    files = {path.name: file_sha256(path) for path in folder.iterdir()}
    write_json(folder / "manifest.json", {"stage": "train", "content": content_sha256(files), "files": files})
    return folder


def train_folder(folder: Path, model: str, **dataset_options: Any) -> Path:
    """A model folder made by `cfem train` from `model`, the YAML of its `model:` key."""
    store_dataset(folder / "samples", **dataset_options)
    spec = folder / "train.yaml"
    spec.write_text(f"dataset: samples\nout: model\nmodel: {model}\n")
    run(spec, [], None, Options(quiet=True))
    return folder / "model"
