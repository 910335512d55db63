"""`cfem report`: reads artefacts, writes report.html with its pictures and results.json."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cfem.core.errors import InputError
from cfem.core.files import write_json, write_whole
from cfem.core.optional import demand
from cfem.core.spec import load_spec, meaning
from cfem.core.stage import Options, Stage, artefact_file, read_manifest, run_stage
from cfem.report.spec import ReportSpec
from cfem.robot.spec import SceneSpec, scene_meaning

VERSION = 4
PATHS = ("scene", "mesh", "samples", "models", "control", "out", "surrogates", "sampling", "meshes", "loops")
FOLDERS = {"surrogates": ("models", "samples", "beyond"), "meshes": ("mesh", "model", "control")}
Manifests = Mapping[str, tuple[Path, dict[str, Any]]]  # of the inputs, by name


def run(spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The manifest. Results: path of the page, headline figures."""
    made = stage(spec_path, overrides, out)
    scene_path = spec_path.parent / made.spec.scene if made.spec.scene else None
    scene = load_spec(scene_path, SceneSpec) if scene_path else None
    return run_stage(
        made, lambda folder: _work(folder, made.spec, scene, scene_path, made.inputs, options.quiet), options
    )


def stage(spec_path: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
    spec, base = load_spec(spec_path, ReportSpec, overrides), spec_path.parent
    extra: dict[str, Any] = {"scene": scene_meaning(base / spec.scene)} if spec.scene else {}
    for name, folders in FOLDERS.items():
        if given := getattr(spec, name):
            extra[name] = {key: meaning(one, folders) for key, one in given.items()}
    return Stage(
        name="report",
        version=VERSION,
        spec=spec,
        inputs=artefacts(spec, base),
        out=out or base / spec.out,
        paths=PATHS,
        extra=extra,
        spec_path=spec_path,
        overrides=overrides,
    )


def artefacts(spec: ReportSpec, base: Path) -> dict[str, Path]:
    """Every folder that the page reads, by its name among the inputs."""
    found: dict[str, Path | None] = {}
    if spec.control:
        found = {"mesh": spec.mesh, "samples": spec.samples}
        found |= {f"model {name}": path for name, path in spec.models.items()} | {"control": spec.control}
    for scene, one in spec.surrogates.items():
        found |= {f"{scene}: model {name}": path for name, path in one.models.items()}
        found |= {f"{scene}: samples": one.samples, f"{scene}: beyond": one.beyond}
    for method, models in spec.sampling.items():
        found |= {f"{method}: {name}, {i + 1}": path for name, paths in models.items() for i, path in enumerate(paths)}
    for name, one in spec.meshes.items():
        found |= {f"mesh {name}: {part}": getattr(one, part) for part in FOLDERS["meshes"]}
    found |= {f"loop {name}": path for name, path in spec.loops.items()}
    return {name: base / path for name, path in found.items() if path}


def _work(
    folder: Path,
    spec: ReportSpec,
    scene: SceneSpec | None,
    scene_path: Path | None,
    inputs: dict[str, Path],
    quiet: bool,
) -> dict[str, Any]:
    demand("matplotlib", where="cfem report")
    from cfem.core.provenance import versions
    from cfem.report import tables
    from cfem.report.discretisation import headline, study
    from cfem.report.page import Section, page
    from cfem.report.sections import discretisation_part

    manifests = {name: (path, read_manifest(path)) for name, path in inputs.items()}
    meshes = study(scene, scene_path.parent, spec.discretisation, quiet) if spec.discretisation else {}
    parts = [
        *(_learned(spec, manifests) if spec.control else ()),
        *([discretisation_part(meshes)] if meshes else ()),
        *_surrogates(spec, manifests),
        *_studies(spec, manifests),
        *_loops(spec, manifests),
    ]
    made_with = manifests["control"][1]["versions"] if spec.control else versions()
    provenance = Section(
        "Where this comes from",
        "Every artefact has a manifest with these hashes; a stage whose inputs have not changed does not run.",
        ((tables.provenance_table(manifests),) if manifests else ()) + (tables.versions_table(made_with),),
    )
    pictures = {name: picture for part in parts for name, picture in part.pictures.items()}
    for name, picture in pictures.items():
        write_whole(folder / f"{name}.png", picture.png)
    title = scene.name if scene else "Learned condensed models"
    sections = [*(part.section for part in parts), provenance]
    write_whole(folder / "report.html", page(title, _lead(spec), sections).encode())
    facts = {key: value for part in parts for key, value in part.facts.items()}
    write_json(folder / "results.json", {**facts, "discretisation": meshes})
    return {
        "headline": headline(meshes.get("meshes", [])),
        "page": "report.html",
        "pictures": sorted(pictures),
        "discretisation": meshes,
    }


def _lead(spec: ReportSpec) -> str:
    if spec.control:
        return "From finite elements to a learned condensed model, from goals to actuators: what it reaches and costs."
    if spec.discretisation:
        return "What the discretisation errs, and what it costs."
    robots = f" of {', '.join(spec.surrogates)}" if spec.surrogates else ""
    return f"Learned models{robots}: what each errs, what it costs, and what it knows of itself."


def _learned(spec: ReportSpec, manifests: Manifests) -> list:
    """Tracking, models and samples of the page's scene."""
    from cfem.dataset.reader import read_dataset
    from cfem.report.dataset_figure import coverage_figure
    from cfem.report.page import Picture
    from cfem.report.sections import models_part, samples_part, tracking_parts
    from cfem.report.tracking_figure import effort_figure

    (samples, sampled), (control, controlled) = manifests["samples"], manifests["control"]
    splits = sorted((name for name in sampled["files"] if name.endswith(".parquet")), reverse=True)
    datasets = {Path(name).stem: read_dataset(artefact_file(samples, name)) for name in splits}
    if "trajectories" not in controlled["results"]:
        raise InputError("is a run over time", where=str(control), do="name it under `loops`, by a name of its own")
    tracking = controlled["results"]["trajectories"]
    effort = "What accuracy costs: distance against the time that control takes for a goal."
    covered = "States solved by finite elements, with actuators that pull and never push."
    models = {name: manifests[f"model {name}"] for name in spec.models}
    trusts = _trusts(models, samples, None)
    return [
        *tracking_parts(_tracked(control, tracking), Picture(effort_figure(tracking), effort), controlled["results"]),
        models_part("The learned model", _results(models), trusts, spec.published),
        samples_part(Picture(coverage_figure(datasets), covered), sampled["results"]),
    ]


def _surrogates(spec: ReportSpec, manifests: Manifests) -> list:
    """One section a robot, its models side by side."""
    from cfem.report.sections import Part, models_part

    found = []
    for scene, one in spec.surrogates.items():
        models = {name: manifests[f"{scene}: model {name}"] for name in one.models}
        samples, beyond = (manifests.get(f"{scene}: {name}", (None,))[0] for name in ("samples", "beyond"))
        trusts = _trusts(models, samples, beyond)
        part = models_part(f"Models of {scene}", _results(models), trusts, one.published, one.default, f"{scene}-")
        found.append(Part(part.section, part.pictures, {scene: part.facts}))
    return found


def _studies(spec: ReportSpec, manifests: Manifests) -> list:
    """Methods of sampling, and meshes."""
    from cfem.report.sections import sampling_part, sizes_part
    from cfem.report.studies import mesh_row, sampling_rows

    found = []
    if spec.sampling:
        rows = []
        for method, models in spec.sampling.items():
            for name, paths in models.items():
                folders = {i: manifests[f"{method}: {name}, {i + 1}"] for i in range(len(paths))}
                rows += sampling_rows(method, name, _results(folders).values())
        found.append(sampling_part(rows))
    if spec.meshes:
        rows = []
        for name, one in spec.meshes.items():
            mesh, control = (manifests[f"mesh {name}: {part}"][1]["results"] for part in ("mesh", "control"))
            model = _results({name: manifests[f"mesh {name}: model"]})[name]
            rows.append(mesh_row(name, mesh, model, control, one.published))
        found.append(sizes_part(rows))
    return found


def _loops(spec: ReportSpec, manifests: Manifests) -> list:
    """One section a run over time."""
    import numpy as np
    import pyarrow.parquet as pq

    from cfem.report.loop_figure import loop_figure
    from cfem.report.page import Picture
    from cfem.report.sections import loop_part

    found = []
    for name in spec.loops:
        path, manifest = manifests[f"loop {name}"]
        if "loop" not in manifest["results"]:
            raise InputError("has no loop in it", where=str(path), do="name it under `control`")
        wanted = ["trajectory", "controller", "seed", "seconds", "goal_index", "goal", "x_e", "error"]
        table = pq.read_table(artefact_file(path, "loop.parquet"), columns=wanted, page_checksum_verification=True)
        columns = {key: np.array(table[key].to_pylist()) for key in wanted}
        pictures = {}
        for trajectory in manifest["results"]["loop"]:
            mine = columns["trajectory"] == trajectory
            rows = {key: values[mine] for key, values in columns.items()}
            title = f"{name}: {trajectory}".replace("-", " ")
            pictures[f"loop-{name}-{trajectory}"] = Picture(
                loop_figure(rows, title), f"{trajectory}: where the effector went, and how far from its goal it was."
            )
        found.append(loop_part(name, pictures, manifest["results"]))
    return found


def _results(models: Mapping[Any, tuple[Path, dict[str, Any]]]) -> dict[Any, dict[str, Any]]:
    """Results of `cfem train` by the keys of `models`."""
    from cfem.report.surrogates import trained

    return {name: trained(manifest["results"], path) for name, (path, manifest) in models.items()}


def _trusts(models: Manifests, samples: Path | None, beyond: Path | None) -> dict:
    """What the flags of each model are worth, by FE states of these datasets."""
    from cfem.dataset.reader import read_dataset
    from cfem.predict.load import load_model
    from cfem.report.surrogates import trust

    if samples is None:
        return {}
    states, outside = (path and read_dataset(artefact_file(path, "test.parquet")) for path in (samples, beyond))
    return {name: trust(load_model(path), states, outside) for name, (path, _) in models.items()}


def _tracked(control: Path, tracking: dict) -> dict:
    """Two pictures a trajectory, the robot in space and the distances; the first robot is also called
    `tracked`."""
    import json

    import numpy as np
    import pyarrow.parquet as pq

    from cfem.report.forces_figure import forces_figure
    from cfem.report.page import Picture
    from cfem.report.robot_figure import robot_figure
    from cfem.report.tracking_figure import tracking_figure

    table = pq.read_table(artefact_file(control, "trajectories.parquet"), page_checksum_verification=True)
    columns = {name: np.array(table[name].to_pylist()) for name in table.column_names}
    meta = json.loads(table.schema.metadata[b"cfem"])
    actuators = meta["rows"][columns["goal"].shape[1] :]
    with np.load(artefact_file(control, "states.npz"), allow_pickle=False) as file:
        states = dict(file)
    found = {}
    for name, controllers in tracking.items():
        full = [one for one in controllers if "@" not in one]
        mine = (columns["trajectory"] == name) & np.isin(columns["controller"], full)
        rows = {key: values[mine] for key, values in columns.items()}
        shown = rows["controller"] == next((one for one in full if one != "fe-based"), full[0])
        if f"{name}/x" in states:
            picture = robot_figure(
                states["X"],
                states["facets"],
                states[f"{name}/x"],
                rows["goal"][shown],
                rows["x_e"][shown],
                name.replace("-", " "),
                int(states.get("object_points", 0)),
            )
            found[f"robot-{name}"] = Picture(picture, f"{name}: the FE robot at some of its goals, at rest in grey.")
        caption = (
            f"{name}: goals, positions that the FE robot reached, and the distances between them (at least 1e-7 mm)."
        )
        found[f"tracking-{name}"] = Picture(tracking_figure(rows, name.replace("-", " ")), caption)
        found[f"tracking-forces-{name}"] = Picture(
            forces_figure(rows, actuators, name.replace("-", " ")), f"{name}: what every controller expects to take."
        )
    first = next((picture for key, picture in found.items() if key.startswith("robot-")), None)
    return {**found, "tracked": first} if first else found
