"""`cfem report`: reads artefacts, writes report.html, its pictures as files, and results.json."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cfem.core.artefact.files import write_json, write_whole
from cfem.core.artefact.judgement import poor, sentences, with_inherited
from cfem.core.artefact.manifest import read_manifest
from cfem.core.optional import demand
from cfem.core.spec import load_spec, meaning
from cfem.core.stage import Command
from cfem.report.spec import ReportSpec
from cfem.robot.spec import SceneSpec, scene_meaning

PATHS = ("scene", "mesh", "samples", "models", "control", "page", "surrogates", "sampling", "meshes", "loops", "moving")
FOLDERS = {"surrogates": ("models", "samples", "beyond"), "meshes": ("mesh", "model", "control")}


def artefacts(spec: ReportSpec, base: Path) -> dict[str, Path]:
    """Folders that the page reads, by their name among the inputs."""
    paths: dict[str, Path | None] = {}
    if spec.control:
        paths = {"mesh": spec.mesh, "samples": spec.samples}
        paths |= {f"model {name}": path for name, path in spec.models.items()} | {"control": spec.control}
        paths["page"] = spec.page
    for scene, study in spec.surrogates.items():
        paths |= {f"{scene}: model {name}": path for name, path in study.models.items()}
        paths |= {f"{scene}: samples": study.samples, f"{scene}: beyond": study.beyond}
    for method, models in spec.sampling.items():
        paths |= {f"{method}: {name}, {i + 1}": path for name, paths in models.items() for i, path in enumerate(paths)}
    for name, study in spec.meshes.items():
        paths |= {f"mesh {name}: {part}": getattr(study, part) for part in FOLDERS["meshes"]}
    paths |= {f"loop {name}": path for name, path in spec.loops.items()}
    paths |= {f"moving {name}": path for name, path in spec.moving.items()}
    return {name: base / path for name, path in paths.items() if path}


def _extra(spec: ReportSpec, base: Path) -> dict[str, Any]:
    extra: dict[str, Any] = {"scene": scene_meaning(base / spec.scene)} if spec.scene else {}
    for name, folders in FOLDERS.items():
        if given := getattr(spec, name):
            extra[name] = {key: meaning(study, folders) for key, study in given.items()}
    return extra


def _work(folder: Path, spec: ReportSpec, base: Path) -> dict[str, Any]:
    """Results: path of the page, headline figures."""
    demand("matplotlib", where="cfem report")
    from cfem.core.console.progress import progress
    from cfem.report.page import Summary, page
    from cfem.report.parts import compared, learned, over_time, provenance
    from cfem.report.sections.discretisation import headline, study
    from cfem.report.sections.interactive import MOVED, page_of

    scene_path = base / spec.scene if spec.scene else None
    scene = load_spec(scene_path, SceneSpec) if scene_path else None
    inputs = artefacts(spec, base)
    manifests = {name: (path, read_manifest(path)) for name, path in inputs.items()}
    if spec.control:
        _demand_one_robot(scene, scene_path, spec, manifests)
    meshes = study(scene, scene_path.parent, spec.discretisation) if spec.discretisation else {}
    with progress("drawing the report", 4) as advance:
        summary, robot, card, sections = learned(spec, scene, manifests)
        advance(1)
        sections = [*sections, *compared(spec, manifests)]
        advance(1)
        loops, over = over_time(spec, manifests)
        sections += loops
        if meshes:
            from cfem.report.sections.discretisation_section import discretisation_section

            sections.append(discretisation_section(meshes))
        sections.append(provenance(spec, manifests))
        advance(1)
        title = scene.name if scene else "Control over time" if over else "Learned condensed models"
        summary = summary or over or Summary(_about(spec))
        judged = {"judgement": [poor(concern) for concern in summary.concerns]}
        first = replace(summary, concerns=tuple(sentences(with_inherited(judged, inputs))))
        write_whole(folder / "report.html", page(title, first, robot, card, sections).encode())
        parts = [part for section in sections for part in section.parts] + [part for part in (robot,) if part]
        files = {name: data for part in parts for name, data in getattr(part, "files", dict)().items()}
        if spec.page:
            write_whole(folder / MOVED, page_of(*manifests["page"]))
        for name, data in files.items():
            write_whole(folder / name, data)
        advance(1)
    facts = {key: value for section in sections for key, value in section.facts.items()}
    write_json(folder / "results.json", {**facts, "discretisation": meshes})
    return {
        **judged,
        "headline": [summary.sentence, *headline(meshes.get("meshes", []))],
        "page": "report.html",
        **({"moved": MOVED} if spec.page else {}),
        "pictures": sorted(files),
        "discretisation": meshes,
    }


def _demand_one_robot(scene: SceneSpec, scene_path: Path, spec: ReportSpec, manifests: Mapping[str, Any]) -> None:
    """Raises InputError where what the page is about is not all of the scene's robot."""
    from cfem.predict.load import read_meta
    from cfem.report.sections.used_models import demand_used
    from cfem.robot.same_robot import demand_mesh_of, demand_robot, recorded_robot

    do = "name results of one robot"
    demand_mesh_of(scene, scene_path, manifests["mesh"][0])
    for name in ("samples", "control"):
        demand_robot(scene, recorded_robot(manifests[name][1]), manifests[name][0], do)
    for folder in [manifests[f"model {name}"][0] for name in spec.models] + (
        [manifests["page"][0]] if spec.page else []
    ):
        demand_robot(scene, read_meta(folder).get("robot"), folder, do)
    shown = {name: str(manifests[f"model {name}"][1]["content"]) for name in spec.models}
    demand_used(*manifests["control"], shown)


def _about(spec: ReportSpec) -> str:
    """Title of a page that tracks nothing."""
    if spec.surrogates or spec.sampling or spec.meshes:
        robots = f" of {', '.join(spec.surrogates)}" if spec.surrogates else ""
        return f"Learned models{robots}: their errors, their costs, and whether their warnings can be trusted."
    if spec.moving and not spec.discretisation:
        return f"How {', '.join(spec.moving)} vibrates, by what its learned model says."
    return "The error of the discretisation, and what it costs to lower it."


COMMAND = Command("report", 9, ReportSpec, _work, outside=PATHS, reads=artefacts, extra=_extra)
run, stage = COMMAND.run, COMMAND.stage
