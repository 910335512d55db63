"""`cfem report`: reads artefacts, writes report.html with its pictures and results.json."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cfem.core.files import write_json, write_whole
from cfem.core.spec import load_spec
from cfem.core.stage import Options, Stage, artefact_file, read_manifest, run_stage
from cfem.report.spec import ReportSpec
from cfem.robot.spec import SceneSpec

VERSION = 1


def run(spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The manifest. Results: path of the page, headline figures."""
    spec = load_spec(spec_path, ReportSpec, overrides)
    base = spec_path.parent
    models = {f"model {name}": base / path for name, path in spec.models.items()}
    inputs = {"mesh": base / spec.mesh, "samples": base / spec.samples, **models, "control": base / spec.control}
    scene = load_spec(base / spec.scene, SceneSpec)
    stage = Stage(
        name="report",
        version=VERSION,
        spec=spec,
        inputs=inputs,
        out=out or base / spec.out,
        paths=("scene", "mesh", "samples", "models", "control", "out"),
        extra={"scene": scene.model_dump(exclude={"out"})},
    )
    return run_stage(stage, lambda folder: _work(folder, spec, scene, (base / spec.scene).parent, inputs), options)


def _work(
    folder: Path, spec: ReportSpec, scene: SceneSpec, scene_folder: Path, inputs: dict[str, Path]
) -> dict[str, Any]:
    from cfem.report import tables
    from cfem.report.discretisation import headline, study
    from cfem.report.page import Section, page

    manifests = {name: (path, read_manifest(path)) for name, path in inputs.items()}
    results = {name: manifest["results"] for name, (_, manifest) in manifests.items()}
    models = {name: results[f"model {name}"] for name in spec.models}
    tracking = results["control"]["trajectories"]
    meshes = []
    if spec.discretisation:
        meshes = [
            case.as_json() for case in study(scene, scene_folder, spec.discretisation, spec.discretisation_states)
        ]
    pictures = _pictures(spec, inputs, models, tracking, meshes)
    for name, picture in pictures.items():
        write_whole(folder / f"{name}.png", picture.png)
    sections = [
        *_tracking_sections(pictures, tracking, results["control"]),
        Section(
            "The learned model",
            "Loss: mean squared error of the entries of W and delta_free, standardised by the test set; errors at the "
            "test states, which no training has seen.",
            (
                tables.model_table(models, spec.published),
                pictures["training"],
                pictures["learning"],
                pictures["inference"],
            ),
        ),
        Section("The samples", _samples_text(results["samples"]), (pictures["coverage"],)),
        *_mesh_sections(pictures, meshes),
        Section(
            "Where this comes from",
            "Every artefact has a manifest with these hashes; a stage whose inputs have not changed does not run.",
            (tables.provenance_table(manifests), tables.versions_table(manifests["control"][1]["versions"])),
        ),
    ]
    lead = "From finite elements to a learned condensed model, from goals to actuators: what it reaches and costs."
    write_whole(folder / "report.html", page(scene.name, lead, sections).encode())
    facts = {
        "models": models,
        "tracking": tracking,
        "mesh": results["mesh"],
        "samples": results["samples"],
        "discretisation": meshes,
    }
    write_json(folder / "results.json", facts)
    return {"headline": headline(meshes), "page": "report.html", "pictures": sorted(pictures), "discretisation": meshes}


def _pictures(spec: ReportSpec, inputs: dict[str, Path], models: dict, tracking: dict, meshes: list) -> dict:
    from cfem.dataset.reader import read_dataset
    from cfem.report.dataset_figure import coverage_figure
    from cfem.report.discretisation import discretisation_figure
    from cfem.report.page import Picture
    from cfem.report.tracking_figure import effort_figure
    from cfem.report.training_figure import inference_figure, learning_figure, training_figure

    splits = [name for name in read_manifest(inputs["samples"])["files"] if name.endswith(".parquet")]
    datasets = {
        Path(name).stem: read_dataset(artefact_file(inputs["samples"], name)) for name in sorted(splits, reverse=True)
    }
    found = {
        **_tracked(inputs["control"], tracking),
        "effort": Picture(
            effort_figure(tracking), "What accuracy costs: distance against the time that control takes for a goal."
        ),
        "coverage": Picture(
            coverage_figure(datasets), "States solved by finite elements, with actuators that pull and never push."
        ),
        "training": Picture(training_figure(models), "Held-out error while the models learn."),
        "learning": Picture(
            learning_figure(models, spec.published), "Error on the test set against the number of FE samples."
        ),
        "inference": Picture(
            inference_figure(models, spec.published), "Error on the test set against the time of one query."
        ),
    }
    if meshes:
        caption = "Error against run time of meshes, judged by the finest; each state is a solve and its condensation."
        found["discretisation"] = Picture(discretisation_figure(meshes), caption)
    return found


def _tracked(control: Path, tracking: dict) -> dict:
    """Two pictures a trajectory, the robot in space and the distances; the first robot is also called
    `tracked`."""
    import numpy as np
    import pyarrow.parquet as pq

    from cfem.report.page import Picture
    from cfem.report.robot_figure import robot_figure
    from cfem.report.tracking_figure import tracking_figure

    table = pq.read_table(artefact_file(control, "trajectories.parquet"), page_checksum_verification=True)
    columns = {name: np.array(table[name].to_pylist()) for name in table.column_names}
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
            )
            found[f"robot-{name}"] = Picture(picture, f"{name}: the FE robot at some of its goals, at rest in grey.")
        caption = (
            f"{name}: goals, positions that the FE robot reached, and the distances between them (at least 1e-7 mm)."
        )
        found[f"tracking-{name}"] = Picture(tracking_figure(rows, name.replace("-", " ")), caption)
    first = next((picture for key, picture in found.items() if key.startswith("robot-")), None)
    return {**found, "tracked": first} if first else found


def _tracking_sections(pictures: dict, tracking: dict, control: dict) -> list:
    from cfem.report.page import Section
    from cfem.report.tables import tracking_table

    robots = tuple(picture for key, picture in pictures.items() if key.startswith("robot-"))
    curves = tuple(picture for key, picture in pictures.items() if key.startswith("tracking-"))
    text = (
        "Each controller turns a goal into actuator displacements with its own model, and the FE robot "
        f"({control['nodes']} nodes) carries them out, open loop. FE-based control is that algorithm on FE matrices. "
        "Goals out of reach end at the nearest point that the robot can reach."
    )
    if control["plant"] == "model":
        text = "Each controller turns a goal into actuator displacements; the first model, no FE robot, obeys them."
    return [
        Section("Tracking", text, ((robots,) if robots else ()) + (tracking_table(tracking), *curves)),
        Section("Time against accuracy", "", (pictures["effort"],)),
    ]


def _mesh_sections(pictures: dict, meshes: list) -> list:
    from cfem.report.page import Section
    from cfem.report.tables import discretisation_table

    if not meshes:
        return []
    text = "The same states on several meshes. W converges later than the tip, which prescribed displacements hide."
    return [Section("The mesh", text, (discretisation_table(meshes), pictures["discretisation"]))]


def _samples_text(results: dict) -> str:
    rows = ", ".join(f"{count} {split}" for split, count in results["rows"].items())
    return f"{rows}; {results['failed']} failed."
