"""`cfem sample`: a scene, its mesh and a plan to a dataset."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cfem.condensed.parameters import to_json
from cfem.core.artefact.judgement import KEY, poor
from cfem.core.artefact.manifest import read_manifest
from cfem.core.artefact.stage_run import Stage
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options, run_stage
from cfem.robot.spec import SceneSpec, demand_driven, scene_meaning
from cfem.sample.parameters import is_of_motion, scene_parameters
from cfem.sample.processes.workers import Workers
from cfem.sample.spec import SEQUENCES, SampleSpec

VERSION = 9
INERTIA = 2  # likewise, of what `dynamics: true` adds
COARSE = "a coarse answer of --quick, from few of the states that the spec asks for"


def run(
    spec_path: Path,
    overrides: Sequence[str],
    out: Path | None,
    options: Options,
    *,
    fill: Callable[..., dict[str, Any]] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
    shard: str | None = None,
    quick: bool = False,
) -> dict[str, Any]:
    """Manifest of the dataset. An interrupted run goes on from the shards that were finished. A dataset of the first
    rows of a sequence is kept, and the others are added to it; so is one that a quick run has left beside it. The scene
    enters by its values: a comment in it makes no dataset stale.

    fill: makes the dataset's files; `cfem.active_learning.fill.fill` samples actively where `spec.until` asks for it
    workers: processes, one a core by default
    scheduler: address of a Dask scheduler, whose workers solve instead
    timeout: s without a finished shard after which workers are given up
    shard: 'i/n', to solve the i-th of n parts alone, for `merge`
    quick: judges the dataset, and what is made from it, to be coarse"""
    spec = load_spec(spec_path, SampleSpec, overrides)
    scene, mesh = spec_path.parent / spec.scene, spec_path.parent / spec.mesh
    parameters = scene_parameters(spec.parameters, scene)
    sampling = stage(spec_path, overrides, out)
    made_from, crew = sampling.made_from(), Workers(workers, scheduler, timeout)

    def factory() -> Any:
        from cfem.robot.load import load_scene_and_mesh
        from cfem.sample.solver import FiniteElements

        turns = None if spec.contact is None else spec.contact.rotation is not None
        robot = load_scene_and_mesh(scene, mesh)
        derivatives = spec.third_order, spec.loads
        return FiniteElements(*robot, spec.tolerance, parameters, *derivatives, turns, spec.dynamics, spec.slack)

    def work(folder: Path) -> dict[str, Any]:
        from cfem.sample import artefact

        known = None if options.force else _first_rows(sampling)
        work_on = fill or artefact.fill
        outcome = work_on(folder, placed(spec, spec_path.parent), factory(), made_from, crew, known)
        if not spec.contact and spec.space != "rest":
            outcome = _with_mesh_error(outcome, folder, spec, spec_path.parent)
        if spec.frequencies:
            outcome = _with_frequencies(outcome, folder, spec, spec_path.parent)
        return {**outcome, KEY: [poor(COARSE), *outcome.get(KEY, [])]} if quick else outcome

    if shard is None:
        return run_stage(sampling, work, options)
    if spec.until or spec.around:
        what = "--shard does not go with until or around: which states come next depends on all before"
        raise SpecError(what, where=str(spec_path), do="leave one of them out")
    from cfem.sample.part import fill_part, parse_part

    part = parse_part(shard)
    part_stage = replace(sampling, out=out or part.folder(sampling.out), extra={**sampling.extra, "part": vars(part)})
    return run_stage(part_stage, lambda folder: fill_part(folder, spec, factory(), made_from, part, crew), options)


def _with_mesh_error(outcome: dict[str, Any], dataset: Path, spec: SampleSpec, base: Path) -> dict[str, Any]:
    """The results of a dataset's folder with the error of the mesh within its range, or that by which the mesh was made
    (`mesh.accuracy`); as they are where neither is known."""
    from cfem.robot.load import load_scene_and_mesh
    from cfem.sample.mesh_error import mesh_error_line, sampled_mesh_error

    error = read_manifest(base / spec.mesh).get("results", {}).get("mesh_error")
    if spec.mesh_error is not None:
        path = base / spec.scene
        scene, mesh = load_scene_and_mesh(path, base / spec.mesh)
        error = sampled_mesh_error(dataset / "train.parquet", scene, mesh, path.parent, spec.mesh_error)
    if error is None:
        return outcome
    outcome = {**outcome, "headline": [*outcome["headline"], mesh_error_line(error)]}
    return {**outcome, "mesh_error": error, "content": _with_content(outcome, error)}


def _with_frequencies(outcome: dict[str, Any], dataset: Path, spec: SampleSpec, base: Path) -> dict[str, Any]:
    """The results of a dataset's folder with the natural frequencies of its test states."""
    from cfem.robot.load import load_scene_and_mesh
    from cfem.sample.frequencies import sampled_frequencies

    frequencies = sampled_frequencies(
        dataset / "test.parquet", *load_scene_and_mesh(base / spec.scene, base / spec.mesh)
    )
    return {**outcome, "frequencies": frequencies, "content": _with_content(outcome, frequencies)}


def _with_content(outcome: dict[str, Any], estimate: Any) -> str:
    """Hash of the content of a dataset with what was estimated from it, as models state that."""
    return hashlib.sha256(json.dumps([outcome["content"], estimate]).encode()).hexdigest()


def merge(
    spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options, parts: Sequence[Path] = ()
) -> dict[str, Any]:
    """The manifest of the dataset of which `parts` (those beside it by default) are all parts, content hash and all as
    if one machine had solved it."""
    sampling = stage(spec_path, overrides, out)

    def work(folder: Path) -> dict[str, Any]:
        from cfem.sample.part import dataset_parts, fill_merged

        return fill_merged(folder, sampling.spec, list(parts) or dataset_parts(sampling.out), sampling.made_from())

    return run_stage(sampling, work, options)


def placed(spec: SampleSpec, base: Path) -> SampleSpec:
    """Spec with the paths of `around` as they are from here."""
    if spec.around is None:
        return spec
    named = {"task": base / spec.around.task, "base": base / (spec.around.base or spec.out)}
    return spec.model_copy(update={"around": spec.around.model_copy(update=named)})


def stage(spec_path: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
    """Stage of a dataset: the scene enters by its values."""
    spec = load_spec(spec_path, SampleSpec, overrides)
    scene, around = spec_path.parent / spec.scene, placed(spec, spec_path.parent).around
    beside = spec_path.parent / (f"{spec.out}-around" if around and spec.around.base is None else spec.out)
    sampling = Stage(
        agrees=lambda: _demand_agreement(spec, load_spec(scene, SceneSpec)),
        name="sample",
        version=VERSION,
        spec=spec,
        inputs={"mesh": spec_path.parent / spec.mesh} | ({"base": around.base} if around else {}),
        out=out or beside,
        # parameters: by their values, not by their spelling
        paths=("scene", "mesh", "out", "parameters", "around"),
        precious=True,
        extra={"scene": scene_meaning(scene), "parameters": to_json(scene_parameters(spec.parameters, scene))}
        | ({"inertia": INERTIA} if spec.dynamics else {})
        # the task is a run of a model that this dataset makes better: it may change without making the dataset stale
        | ({"around": [around.add, around.judges, spec.around.task.as_posix()]} if around else {}),
        spec_path=spec_path,
        overrides=overrides,
    )
    if spec.until or spec.around:
        return sampling
    return replace(sampling, extends=lambda manifest: continues(sampling.origin(), manifest.get("origin")))


def _demand_agreement(spec: SampleSpec, scene: SceneSpec) -> None:
    """SpecError where nothing drives the robot, or its discrepancy says nothing about what is asked for."""
    demand_driven(scene)
    asked = {"parameters": spec.parameters, "loads": spec.loads, "dynamics": spec.dynamics, "contact": spec.contact}
    for key in (key for key, value in asked.items() if value and scene.discrepancy):
        what = "the scene's discrepancy, of a calibration, is of its states at rest, and says nothing about it"
        raise SpecError(what, where=key, do="take `discrepancy` out of the scene, or leave this out")
    weighed = scene.gravity or any(item.at == "centre-of-mass" for item in scene.effectors)
    for name, parameter in spec.parameters.items() if not spec.dynamics else ():
        key = parameter.key
        if is_of_motion(key) and not (key.endswith("density") and weighed):
            what = f"'{key}' changes no state of the robot at rest"
            raise SpecError(what, where=f"parameters.{name}", do="set `dynamics: true`, or leave it out")


def quick_folder(out: Path) -> Path:
    """Folder in which a quick run leaves what the full run puts to `out`."""
    return out.with_name(f"{out.name}-quick")


def _first_rows(sampling: Stage) -> Path | None:
    """Folder of a dataset of the first rows: what is there, else what a quick run has left; None where there is
    none."""
    places = (sampling.out, quick_folder(sampling.out))
    return next((place for place in places if replace(sampling, out=place).extended()), None)


def continues(origin: dict[str, Any], before: Any) -> bool:
    """True where a dataset of the origin `before` holds the first rows of one of `origin`, and differs in nothing
    else."""
    if not isinstance(before, dict) or before.get("stage") != origin["stage"]:
        return False
    (splits, rest), (old_splits, old_rest) = _apart(origin), _apart(before)
    return rest == old_rest and all(
        splits[name]["rows"] == old["rows"] or (splits[name]["rows"] > old["rows"] and old["method"] in SEQUENCES)
        for name, old in old_splits.items()
    )


def _apart(origin: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The splits of an origin, and the origin without their numbers of rows and what is estimated from them."""
    splits = origin["spec"]["splits"]
    uncounted = {name: {**split, "rows": None} for name, split in splits.items()}
    return splits, {**origin, "spec": {**origin["spec"], "splits": uncounted, "mesh_error": None, "frequencies": None}}
