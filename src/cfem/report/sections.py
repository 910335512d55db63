"""The sections of the page, each with its pictures and its facts, from values; no files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from cfem.report import tables
from cfem.report.page import Picture, Section
from cfem.report.spec import Published
from cfem.report.surrogates import Trust, trust_summary


@dataclass(frozen=True)
class Part:
    """section; pictures by the name of their file; facts: for results.json."""

    section: Section
    pictures: dict[str, Picture] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)


def tracking_parts(pictures: dict[str, Picture], effort: Picture, control: Mapping[str, Any]) -> list[Part]:
    """pictures: of the robot (`robot-...`) and of distances (`tracking-...`); control: results of `cfem control`."""
    robots = tuple(picture for key, picture in pictures.items() if key.startswith("robot-"))
    curves = tuple(picture for key, picture in pictures.items() if key.startswith("tracking-"))
    tracking = control["trajectories"]
    text = (
        "Each controller turns a goal into actuator displacements with its own model, and the FE robot "
        f"({control['nodes']} nodes) carries them out, open loop. FE-based control is that algorithm on FE matrices. "
        "Goals out of reach end at the nearest point that the robot can reach."
    )
    if control["plant"] == "model":
        text = "Each controller turns a goal into actuator displacements; the first model, no FE robot, obeys them."
    shown = ((robots,) if robots else ()) + (tables.tracking_table(tracking), *curves)
    return [
        Part(Section("Tracking", text, shown), pictures, {"tracking": tracking}),
        Part(Section("Time against accuracy", "", (effort,)), {"effort": effort}),
    ]


def loop_part(name: str, pictures: dict[str, Picture], control: Mapping[str, Any]) -> Part:
    """control: results of `cfem control` with a loop."""
    text = (
        "Tick by tick: what the sensor last said, the state that the controller believes in, one inverse step, one "
        "command. Distances are of the true position."
    )
    shown = (tables.loop_table(control["loop"]), *pictures.values())
    return Part(Section(f"Over time: {name}", text, shown), pictures, {f"loop {name}": control["loop"]})


def samples_part(coverage: Picture, results: Mapping[str, Any]) -> Part:
    """results: of `cfem simulate-sample`."""
    rows = ", ".join(f"{count} {split}" for split, count in results["rows"].items())
    section = Section("The samples", f"{rows}; {results['failed']} failed.", (coverage,))
    return Part(section, {"coverage": coverage}, {"samples": results})


def models_part(
    title: str,
    models: Mapping[str, Mapping[str, Any]],
    trusts: Mapping[str, Trust],
    published: Published | None = None,
    default: str | None = None,
    prefix: str = "",
) -> Part:
    """Models of one robot: results of `cfem train` by name, and what their flags are worth where that was judged.

    prefix: of the names of the pictures' files."""
    from cfem.report.surrogates_figure import error_figure, trust_figure
    from cfem.report.training_figure import training_figure

    pictures = {
        "errors": Picture(
            error_figure(models, published, default),
            "Errors on the test states against what they cost: FE samples, training, sampling and training on one "
            "core, and one query. Each line is one model from more and more samples; the large mark is all of them.",
        ),
        "training": Picture(
            training_figure(models), "Held-out error while the models learn; a ring is the number of terms chosen."
        ),
    }
    summaries = {name: trust_summary(found) for name, found in trusts.items()}
    shown = [
        tables.model_table(models, published, default),
        pictures["errors"],
        tables.definite_table(models),
        tables.choice_table(models),
        pictures["training"],
    ]
    if trusts:
        pictures["trust"] = Picture(
            trust_figure(trusts),
            "States that FE solved: how far a model errs, against how far from its training states it says that they "
            "are. Right of the dashed line, or outside the box of the training states, it flags them. A flag is worth "
            "something where red lies above blue.",
        )
        shown += [pictures["trust"], tables.trust_table(summaries)]
    text = (
        "Loss: mean squared error of the entries of W and delta_free, standardised by the test set; errors at the test "
        "states, which no training has seen. W was checked at random states between the samples."
    )
    facts = {"models": {name: dict(results) for name, results in models.items()}, "trust": summaries}
    return Part(Section(title, text, tuple(shown)), {prefix + name: one for name, one in pictures.items()}, facts)


def sampling_part(rows: Sequence[Mapping[str, Any]]) -> Part:
    """rows: of `cfem.report.studies.sampling_rows`."""
    from cfem.report.surrogates_figure import sampling_figure

    picture = Picture(sampling_figure(rows), "The same models from as many rows, sampled in different ways.")
    text = "Every model is judged by the same random states. A grid includes the ends of the domain."
    section = Section("Where to sample", text, (picture, tables.sampling_table(rows)))
    return Part(section, {"sampling": picture}, {"sampling": list(rows)})


def sizes_part(rows: Sequence[Mapping[str, Any]]) -> Part:
    """rows: of `cfem.report.studies.mesh_row`."""
    from cfem.report.surrogates_figure import meshes_figure

    picture = Picture(
        meshes_figure(rows),
        "What a finer mesh asks of the model, and of control with the model or with the mesh itself.",
    )
    text = (
        "Each model is judged by test states of its own mesh. A step of control is one query of the model, or one FE "
        "solve, and the quadratic program; the median is counted."
    )
    section = Section("From coarse meshes to fine ones", text, (picture, tables.sizes_table(rows)))
    return Part(section, {"meshes": picture}, {"meshes": list(rows)})


def discretisation_part(meshes: Mapping[str, Any]) -> Part:
    """meshes: of `cfem.report.discretisation.study`."""
    from cfem.report.discretisation_figure import front_figure, poisson_figure

    rows = meshes["meshes"]
    ratios = sorted({row["poisson"] for row in rows})
    caption = "Error against run time of meshes, judged by the finest; a sample is a solve from a near state and its W."
    pictures = {"discretisation": Picture(front_figure(rows, ratios[len(ratios) // 2]), caption)}
    if len(ratios) > 1:
        pictures["poisson"] = Picture(poisson_figure(rows), "What near incompressibility does to each mesh.")
    text = (
        "The same states on several meshes. W converges later than the tip, which prescribed displacements hide. "
        "Graded meshes are finest where W needs it."
    )
    shown = [*pictures.values(), tables.discretisation_table(rows)]
    if meshes["orders"]:
        shown.append(tables.orders_table(meshes["orders"]))
    if meshes["tolerances"]:
        shown.append(tables.tolerance_table(meshes["tolerances"]))
    return Part(Section("The mesh", text, tuple(shown)), pictures)
