"""`cfem report`: reads artefacts, writes report.html with its pictures and results.json."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cfem.core.files import write_json, write_whole
from cfem.core.spec import load_spec, meaning
from cfem.core.stage import Options, Stage, artefact_file, read_manifest, run_stage
from cfem.report.spec import ReportSpec
from cfem.robot.spec import SceneSpec

VERSION = 2


def run(spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The manifest. Results: path of the page, headline figures."""
    spec = load_spec(spec_path, ReportSpec, overrides)
    base = spec_path.parent
    models = {f"model {name}": base / path for name, path in spec.models.items()}
    inputs = {}
    if spec.control:
        inputs = {"mesh": base / spec.mesh, "samples": base / spec.samples, **models, "control": base / spec.control}
    scene = load_spec(base / spec.scene, SceneSpec)
    stage = Stage(
        name="report",
        version=VERSION,
        spec=spec,
        inputs=inputs,
        out=out or base / spec.out,
        paths=("scene", "mesh", "samples", "models", "control", "out"),
        extra={"scene": meaning(scene, {"out"})},
    )
    return run_stage(
        stage, lambda folder: _work(folder, spec, scene, (base / spec.scene).parent, inputs, options.quiet), options
    )


def _work(
    folder: Path, spec: ReportSpec, scene: SceneSpec, scene_folder: Path, inputs: dict[str, Path], quiet: bool
) -> dict[str, Any]:
    from cfem.core.provenance import versions
    from cfem.report import tables
    from cfem.report.discretisation import headline, study
    from cfem.report.page import Section, page

    manifests = {name: (path, read_manifest(path)) for name, path in inputs.items()}
    meshes = study(scene, scene_folder, spec.discretisation, quiet) if spec.discretisation else {}
    sections, pictures, facts = _learned(spec, inputs, manifests) if inputs else ([], {}, {})
    if meshes:
        pictures |= _mesh_pictures(meshes)
        sections.append(_mesh_section(pictures, meshes))
    provenance = (tables.provenance_table(manifests),) if manifests else ()
    made_with = next(
        (manifest["versions"] for name, (_, manifest) in manifests.items() if name == "control"), versions()
    )
    sections.append(
        Section(
            "Where this comes from",
            "Every artefact has a manifest with these hashes; a stage whose inputs have not changed does not run.",
            (*provenance, tables.versions_table(made_with)),
        )
    )
    for name, picture in pictures.items():
        write_whole(folder / f"{name}.png", picture.png)
    lead = "From finite elements to a learned condensed model, from goals to actuators: what it reaches and costs."
    if not inputs:
        lead = "What the discretisation errs, and what it costs."
    write_whole(folder / "report.html", page(scene.name, lead, sections).encode())
    write_json(folder / "results.json", {**facts, "discretisation": meshes})
    return {
        "headline": headline(meshes.get("meshes", [])),
        "page": "report.html",
        "pictures": sorted(pictures),
        "discretisation": meshes,
    }


def _learned(spec: ReportSpec, inputs: dict[str, Path], manifests: dict) -> tuple[list, dict, dict]:
    """Sections, pictures and facts about samples, models and tracking."""
    from cfem.report import tables
    from cfem.report.page import Section

    results = {name: manifest["results"] for name, (_, manifest) in manifests.items()}
    models = {name: results[f"model {name}"] for name in spec.models}
    tracking = results["control"]["trajectories"]
    pictures = _pictures(spec, inputs, models, tracking)
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
    ]
    facts = {"models": models, "tracking": tracking, "mesh": results["mesh"], "samples": results["samples"]}
    return sections, pictures, facts


def _pictures(spec: ReportSpec, inputs: dict[str, Path], models: dict, tracking: dict) -> dict:
    from cfem.dataset.reader import read_dataset
    from cfem.report.dataset_figure import coverage_figure
    from cfem.report.page import Picture
    from cfem.report.tracking_figure import effort_figure
    from cfem.report.training_figure import inference_figure, learning_figure, training_figure

    splits = [name for name in read_manifest(inputs["samples"])["files"] if name.endswith(".parquet")]
    datasets = {
        Path(name).stem: read_dataset(artefact_file(inputs["samples"], name)) for name in sorted(splits, reverse=True)
    }
    return {
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


def _mesh_pictures(meshes: dict) -> dict:
    from cfem.report.discretisation_figure import front_figure, poisson_figure
    from cfem.report.page import Picture

    rows = meshes["meshes"]
    ratios = sorted({row["poisson"] for row in rows})
    nominal = ratios[len(ratios) // 2]
    caption = "Error against run time of meshes, judged by the finest; a sample is a solve from a near state and its W."
    found = {"discretisation": Picture(front_figure(rows, nominal), caption)}
    if len(ratios) > 1:
        found["poisson"] = Picture(poisson_figure(rows), "What near incompressibility does to each mesh.")
    return found


def _mesh_section(pictures: dict, meshes: dict):
    from cfem.report import tables
    from cfem.report.page import Section

    text = (
        "The same states on several meshes. W converges later than the tip, which prescribed displacements hide. "
        "Graded meshes are finest where W needs it."
    )
    parts = [pictures[name] for name in ("discretisation", "poisson") if name in pictures]
    parts.append(tables.discretisation_table(meshes["meshes"]))
    if meshes["orders"]:
        parts.append(tables.orders_table(meshes["orders"]))
    if meshes["tolerances"]:
        parts.append(tables.tolerance_table(meshes["tolerances"]))
    return Section("The mesh", text, tuple(parts))


def _samples_text(results: dict) -> str:
    rows = ", ".join(f"{count} {split}" for split, count in results["rows"].items())
    return f"{rows}; {results['failed']} failed."
