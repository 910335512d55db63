"""Artefacts: stages that make them, datasets and models read from them."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cfem.api.vectors import PathLike
from cfem.core.optional import says_what_is_missing

if TYPE_CHECKING:
    from cfem.dataset.reader import Dataset
    from cfem.predict.protocol import Predictor


@says_what_is_missing
def run_stage(
    stage: Literal["mesh", "sample", "train", "export", "control", "calibrate", "optimize-design", "report"],
    spec: PathLike,
    *,
    out: PathLike | None = None,
    overrides: Sequence[str] = (),
    force: bool = False,
    check: bool = False,
    quiet: bool = True,
    **more: Any,
) -> Mapping[str, Any]:
    """Runs one stage, as `cfem STAGE SPEC` does. A stage whose inputs have not changed does nothing.

    Args:
        stage: name of the command.
        spec: its YAML file.
        out: artefact folder, instead of the spec's.
        overrides: values in place of the spec's, such as `"mesh.size=8 mm"`.
        force: run even if up to date.
        check: run nothing; GateError where the output is stale.
        quiet: no progress on stderr.
        **more: for sample: `workers`, `scheduler`, `timeout`, `shard`.

    Returns:
        The manifest: `status` ('done' or 'up to date'), `results`, `files`, `seconds`, `made_from`, `content`.

    Raises:
        CfemError: the subclass of the exit code that the command would end with.

    Examples:
        >>> manifest = cfem.run_stage("mesh", "pipelines/bar/scene.yaml")
        >>> manifest["results"]["nodes"]
    """
    from cfem.core.artefact.chain import stage_module
    from cfem.core.stage import Options
    from cfem.pipeline.plan import kind_named

    kind = kind_named(stage)
    if kind == "sample":
        more = {"fill": import_module("cfem.active_learning.fill").fill, **more}
    options = Options(force=force, check=check, quiet=quiet)
    return stage_module(kind).run(Path(spec), overrides, None if out is None else Path(out), options, **more)


@says_what_is_missing
def run_folder(
    *places: PathLike,
    until: str | None = None,
    overrides: Sequence[str] = (),
    force: bool = False,
    check: bool = False,
    quiet: bool = True,
) -> Mapping[str, Any]:
    """Runs the stages of a folder of specs that are stale, in order, and what they need, as `cfem run FOLDER` does.

    Args:
        *places: folders of specs, or single specs.
        until: the last stage to run.
        overrides: values in place of the specs', by the spec's name, such as `"train.samples=20"`.
        force: replace samples and runs of hardware that are stale; the old ones are moved aside.
        check: run nothing; GateError where a stage is stale.
        quiet: no progress on stderr.

    Returns:
        `status` ("done" or "up to date"), `seconds`, and `results`: `stages` (of each its `stage`, `spec`, `out`,
        `status` and `why`), `headline`, and `judgement` where a result should not be trusted.

    Raises:
        CfemError: the subclass of the exit code that the command would end with.

    Examples:
        >>> done = cfem.run_folder("pipelines/bar", until="train")
        >>> [(one["stage"], one["status"]) for one in done["results"]["stages"]]
    """
    from cfem.core.stage import Options
    from cfem.pipeline.run import run

    return run([Path(place) for place in places], overrides, Options(force=force, check=check, quiet=quiet), until)


@says_what_is_missing
def read_dataset(path: PathLike, split: Literal["train", "test"] = "train") -> "Dataset":
    """The converged states of a dataset.

    Args:
        path: a folder of `cfem sample`, or one of its .parquet files.
        split: which file of the folder.

    Returns:
        The dataset of m states: `delta_a` (m, n_a), `delta_e` (m, n_e) mm, `lambda_a` (m, n_a), `W` (m, n, n),
        `delta_free` (m, n), `energy` (m,) N mm, `failed`, a table of the states that did not converge.

    Raises:
        InputError: it is missing, damaged, or no dataset of cfem.

    Examples:
        >>> states = cfem.read_dataset("data/bar/samples", "test")
        >>> states.delta_a, states.W[0]
    """
    from cfem.core.artefact.content import artefact_file
    from cfem.dataset.reader import read_dataset as read_file

    path = Path(path)
    return read_file(artefact_file(path, f"{split}.parquet") if path.is_dir() else path)


@says_what_is_missing
def load_model(folder: PathLike, runtime: Literal["arrays", "onnx"] = "arrays") -> "Predictor":
    """A learned model of the condensed robot.

    Args:
        folder: of `cfem train` or `cfem export`.
        runtime: arrays needs NumPy alone; onnx needs onnxruntime and an exported folder.

    Returns:
        The model. `at_displacement(delta_a)` and `at_force(lambda_a)` take (n_a,) or a batch (..., n_a) and return the
        condensed robot there: `W` (..., n, n), `delta_free` (..., n), `delta_e` (..., n_e) mm from rest, `delta_a`,
        `lambda_a` (..., n_a). Both take parameters (n_p,) as a second argument where the model has them.
        `jacobian(state)` (..., n_e, n_a) is d delta_e / d delta_a. `workspace(states)` says where the effectors can be.
        `inside(state)` and `distance(state)` say how near the training states are. `rest_e` (n_e,) mm, `reach`
        (n_a, 2), `rows`.
        `shape(delta_a)` gives the whole surface, (..., nodes, 3) mm for (..., n_a), `facets` (t, 3) its triangles, and
        `whole(delta_a)` the condensed robot with the rows of the surface's modes.

    Raises:
        InputError: a file is missing or damaged, or the model is of another version.
        NumericalError: (when asked) there is no such state.

    Examples:
        >>> model = cfem.load_model("models/bar/spectral")
        >>> model.at_displacement([5.0]).delta_e, model.at_force([1.0]).delta_e
        >>> model.shape([5.0]).shape, model.facets.shape
    """
    from cfem.predict.load import load_model as load

    return load(Path(folder), runtime)
