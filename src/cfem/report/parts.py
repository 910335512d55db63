"""Parts of a page, from the artefacts that its spec names."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.provenance import versions
from cfem.core.errors import InputError
from cfem.dataset.reader import read_dataset
from cfem.motion.load import FILE as MOTION
from cfem.motion.load import load_motion
from cfem.predict.load import load_model
from cfem.report.page import Card, ReportSection, Summary
from cfem.report.run_viewer import animation
from cfem.report.sections.gait import gait_section, gait_summary
from cfem.report.sections.interactive import link
from cfem.report.sections.loops import loop_section
from cfem.report.sections.models import models_section, trained
from cfem.report.sections.robot import card
from cfem.report.sections.samples import read_splits, samples_section, units_of
from cfem.report.sections.studies import mesh_row, sampling_rows, sampling_section, sizes_section
from cfem.report.sections.summary import loops_summary, tracking_summary
from cfem.report.sections.tracking import read_tracking, tracking_section
from cfem.report.sections.trust import Trust, trust
from cfem.report.spec import ReportSpec
from cfem.report.tables import ReportTable, number, tabulate
from cfem.report.viewer import Viewer
from cfem.robot.mesh.mesh_file import read_mesh
from cfem.robot.spec import SceneSpec
from cfem.robot.stage import MESH

Manifests = Mapping[str, tuple[Path, dict[str, Any]]]  # of the inputs, by name


class LearnedParts(NamedTuple):
    """Parts of a page about learned models of one scene, none where it is not about them."""

    summary: Summary | None = None
    robot: Viewer | None = None
    card: Card | None = None
    sections: Sequence[ReportSection] = ()


def learned(spec: ReportSpec, scene: SceneSpec | None, manifests: Manifests) -> LearnedParts:
    """Tracking, models and samples of the page's scene, where it has one and is about them."""
    if scene is None or not spec.control:
        return LearnedParts()
    (samples, sampled), (control, controlled) = manifests["samples"], manifests["control"]
    if "trajectories" not in controlled["results"]:
        raise InputError("is a run over time", where=str(control), do="name it under `loops`, by a name of its own")
    splits = read_splits(samples, sampled)
    data = next(iter(splits.values()))
    units, tracking = units_of(data), read_tracking(control, controlled)
    models = {name: manifests[f"model {name}"] for name in spec.models}
    results, trusts = _results(models), _trusts(models, samples, None)
    forces = {units[name][1] for name in data.rows.actuators}
    force = forces.pop() if len(forces) == 1 else "N, MPa"
    mesh = read_mesh(artefact_file(manifests["mesh"][0], MESH))
    control_results, crawls = controlled["results"], bool(controlled["spec"].get("gait"))
    sections = [
        gait_section(tracking, control_results, units) if crawls else tracking_section(tracking, units),
        models_section("The learned model", results, trusts, spec.published, force=force),
        samples_section(splits, sampled["results"]),
        *_vibrating({name: path for name, (path, _) in models.items() if (path / MOTION).exists()}),
    ]
    summary = gait_summary(tracking, control_results) if crawls else tracking_summary(tracking)
    shown = card(scene, mesh, data)
    if spec.page:
        shown = replace(shown, link=link(*manifests["page"]))
    return LearnedParts(summary, animation(control, controlled, tracking, scene), shown, sections)


def compared(spec: ReportSpec, manifests: Manifests) -> list[ReportSection]:
    """Sections on models of several robots, methods of sampling, and meshes."""
    sections = []
    for scene, study in spec.surrogates.items():
        models = {name: manifests[f"{scene}: model {name}"] for name in study.models}
        samples, beyond = (manifests.get(f"{scene}: {name}", (None,))[0] for name in ("samples", "beyond"))
        trusts, results = _trusts(models, samples, beyond), _results(models)
        section = models_section(f"Models of {scene}", results, trusts, study.published, study.default, f"{scene}-")
        sections.append(ReportSection(section.title, section.text, section.parts, {scene: section.facts}))
    if spec.sampling:
        rows = []
        for method, models in spec.sampling.items():
            for name, paths in models.items():
                folders = {i: manifests[f"{method}: {name}, {i + 1}"] for i in range(len(paths))}
                rows += sampling_rows(method, name, _results(folders).values())
        sections.append(sampling_section(rows))
    if spec.meshes:
        rows = []
        for name, study in spec.meshes.items():
            mesh, control = (manifests[f"mesh {name}: {part}"][1]["results"] for part in ("mesh", "control"))
            model = _results({name: manifests[f"mesh {name}: model"]})[name]
            rows.append(mesh_row(name, mesh, model, control, study.published))
        sections.append(sizes_section(rows))
    return sections + _vibrating({name: manifests[f"moving {name}"][0] for name in spec.moving})


def _vibrating(folders: Mapping[str, Path]) -> list[ReportSection]:
    """Section on models that move."""
    from cfem.report.sections.vibrations import vibrations_section

    return [vibrations_section({name: load_motion(path) for name, path in folders.items()})] if folders else []


def over_time(spec: ReportSpec, manifests: Manifests) -> tuple[list[ReportSection], Summary | None]:
    """Sections of the runs over time, one each, and a sentence on all of them."""
    sections = [loop_section(name, *manifests[f"loop {name}"]) for name in spec.loops]
    loops = {name: manifests[f"loop {name}"][1]["results"]["loop"] for name in spec.loops}
    return sections, loops_summary(loops) if loops else None


def provenance(spec: ReportSpec, manifests: Manifests) -> ReportSection:
    """Section on what made every artefact, and with which packages."""
    made_with = manifests["control"][1]["versions"] if spec.control else versions()
    artefacts = tabulate(
        manifests.items(),
        {
            "artefact": lambda row: row[0],
            "command": lambda row: f"cfem {row[1][1]['stage']}",
            "content (SHA-256)": lambda row: row[1][1]["content"][:16],
            "made from": lambda row: row[1][1]["made_from"][:16],
            "time (s)": lambda row: number(row[1][1]["seconds"]),
        },
    )
    packages = ReportTable(("package", "version"), list(made_with.items()), words=True)
    text = "Every artefact has a manifest with these hashes. A stage whose inputs have not changed does not run again."
    return ReportSection("Where this comes from", text, ((artefacts,) if manifests else ()) + (packages,))


def _results(models: Mapping[Any, tuple[Path, dict[str, Any]]]) -> dict[Any, dict[str, Any]]:
    """Results of `cfem train` by the keys of `models`."""
    return {name: trained(manifest["results"], path) for name, (path, manifest) in models.items()}


def _trusts(models: Manifests, samples: Path | None, beyond: Path | None) -> dict[str, Trust]:
    """Trust in each model's warning of states outside its domain, by FE states of the datasets `samples` and `beyond`.
    The latter reaches farther."""
    if samples is None:
        return {}
    states, outside = (path and read_dataset(artefact_file(path, "test.parquet")) for path in (samples, beyond))
    return {name: trust(load_model(path), states, outside) for name, (path, _) in models.items()}
