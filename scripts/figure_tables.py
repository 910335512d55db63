"""Tables of Markdown from the measured figures (docs/figures.json): a function per table, listed in TABLES."""

from markdown_table import markdown
from mechanics_tables import convergence_table, mechanics_table, meshes_table, profile_table

from cfem.core.console.shown import length


def readme_table(f: dict, other: dict) -> str:
    """The figures that a newcomer asks for: first those of a robot that the model has not learned (`other`)."""
    loop, process, curve = f["closed_curve"], f["process"], f["learning_curve"]
    paper = f["mlp"]
    rows = [
        *(
            (
                f"a robot that differs from the model, {name} loop: tracking error, mean / largest",
                f"{other[name]['mean']:.2g} / {other[name]['max']:.2g} mm",
            )
            for name in ("open", "closed")
        ),
        (
            "the robot that the model has learned (FE, the same mesh): largest tracking error",
            length(loop["spectral"]["max"], digits=2),
        ),
        ("the same with the paper's network", length(loop["mlp"]["max"], digits=2)),
        ("samples for the paper's loss of 3.8e-6", f"30 (loss {curve['30']:.0e}); the paper used 6500"),
        ("training time; the paper's network", f"{f['spectral']['seconds']:.1g} s; {paper['seconds'] / 60:.1f} min"),
        ("control step (model and QP), one core, median", f"{process['median_us']:.0f} µs"),
        ("memory of the controller's process, without PyTorch", f"{process['peak_rss_mib']:.0f} MiB"),
    ]
    return markdown(("figure", "measured"), rows)


def finger_table(f: dict) -> str:
    """Markdown: what, target, measured, command."""
    v, curve, spectral, mlp = f["verification"], f["learning_curve"], f["spectral"], f["mlp"]
    loop, arc, process = f["closed_curve"], f["quarter_circle"], f["process"]
    verify = "`benchmarks/verification.py`"
    rows = [
        ("tangent against finite differences", "1e-6", f"{v['tangent']:.1e}", verify),
        ("W against finite differences of whole solves", "1e-6", f"{v['W']:.1e}", verify),
        ("energy gradient against cable forces", "1e-6", f"{v['energy_gradient']:.1e}", verify),
        ("patch test; rigid motion; cantilever against the elastica", "1e-12; 1e-12; 1 %", "asserted", "`make test`"),
        (
            f"largest residual of {sum(f['samples']['rows'].values())} stored states ({f['samples']['failed']} failed)",
            "1e-8",
            f"{f['samples']['residual_max']:.1e}",
            "`cfem sample sample-large.yaml`",
        ),
        (
            "factorisations per sample: this mesh / linear tetrahedra",
            "2.5",
            f"{f['samples']['factorizations_per_sample']:.2f} / {f['tet4']['factorizations_per_sample']:.2f}",
            "`cfem inspect data/soft-finger/samples-large`",
        ),
        (
            f"samples per second, one core, {f['tet4_cells']} linear tetrahedra",
            "30",
            f"{f['tet4']['samples_per_second_per_core']:.0f}",
            "`cfem sample ../soft-finger-tet4/sample.yaml`",
        ),
        (
            "energy model: the paper's loss from 30 / 50 / 100 / 200 samples",
            "3.8e-6 / - / - / 1e-9",
            " / ".join(f"{curve[n]:.1e}" for n in ("30", "50", "100", "200")),
            "`cfem train train-large.yaml`",
        ),
        (
            "its largest errors on the test states: tip, cable force",
            "",
            f"{length(spectral['tip_mm'], digits=2)}, {spectral['force_N']:.1e} N",
            "same",
        ),
        (
            f"the paper's network, {mlp['samples']} samples: loss; largest tip error; training",
            "3.8e-6",
            f"{mlp['loss']:.1e}; {length(mlp['tip_mm'], digits=2)}; {mlp['seconds'] / 60:.1f} min",
            "`cfem train train-mlp.yaml`",
        ),
        (
            "closed curve in the FE plant, energy model: tracking error, mean / max",
            "20 / 100 µm",
            spread(loop["spectral"]),
            "`cfem control control-large.yaml`",
        ),
        ("the same with the paper's network", "", spread(loop["mlp"]), "same"),
        (
            f"the paper's quarter circle, {f['reachable'][0]} of {f['reachable'][1]} goals reachable: "
            "distance to FE-based control",
            "20 / 100 µm",
            spread(arc["spectral"]),
            "same",
        ),
        ("the same with the paper's network", "", spread(arc["mlp"]), "same"),
        (
            "control step (query + QP), one core, median / p99",
            "150 µs",
            f"{process['median_us']:.0f} / {process['p99_us']:.0f} µs",
            "`benchmarks/control_process.py`",
        ),
        ("memory of that process, no PyTorch", "60 MiB", f"{process['peak_rss_mib']:.0f} MiB", "same"),
        ("`cfem --help`", "0.5 s", f"{f['help_seconds']:.2f} s", ""),
    ]
    return markdown(("figure", "target", "measured", "command"), rows)


def surrogates_table(f: dict) -> str:
    """Error against samples and costs, a row a robot, model and number of samples."""
    rows = [
        (
            robot,
            model.replace("-", " ", 1) if model.endswith("force") else model,
            str(point["samples"]),
            f"{point['loss']:.1e}",
            f"{point['tip_mm']:.2g} ({point['tip_percent']:.1g} %)",
            f"{point['force_N']:.1g}",
            f"{point['sampling_seconds']:.0f}",
            f"{point['fit_seconds']:.2g}",
            f"{point['query_us']:.0f}",
            f"{100 * found['definite']:.5g} %" if point is found["curve"][-1] else "",
        )
        for robot, models in f["surrogates"]["robots"].items()
        for model, found in models.items()
        for point in found["curve"]
    ]
    head = (
        "robot",
        "model",
        "samples",
        "loss",
        "tip error, max (mm)",
        "force error, max (N)",
        "sampling (s, one core)",
        "fit (s)",
        "query (µs)",
        "W definite",
    )
    return markdown(head, rows)


def contact_table(f: dict) -> str:
    paper = {"finger-button": ("1e-6", "1.67e-6"), "soft-gripper": ("1e-6", "1.24e-3")}
    rows = []
    for scene, one in f["contact"]["held"].items():
        target = "{} (paper {})".format(*paper[scene]) if scene in paper else ""
        last = one["curve"][-1]
        losses = " / ".join(f"{point['loss']:.1e}" for point in one["curve"])
        samples = " / ".join(str(point["samples"]) for point in one["curve"])
        rows.append((f"{scene}: loss from {samples} samples", target, losses))
        rows.append(
            (
                f"{scene}: largest error of tip, force",
                "",
                f"{length(last['tip_mm'], digits=2)}, {last['force_N']:.1e} N",
            )
        )
        rows.append((f"{scene}: W definite at 1e5 random states", "100 %", f"{100 * one['definite']:.3f} %"))
        for name, controllers in one["trajectories"].items():
            learned, fe = controllers["spectral"], controllers.get("fe-based")
            near = learned["distance_to_reachable_goals"]
            rows.append(
                (
                    f"{name}, plans reach {learned['reachable']} of {learned['goals']} goals; FE plant: "
                    "tracking error, mean / max",
                    {"finger-button": "0.01 mm", "soft-gripper": "0.02 mm"}.get(scene, ""),
                    spread(near),
                )
            )
            if fe:
                rows.append((f"{name}: the same by FE-based control", "", spread(fe["distance_to_reachable_goals"])))
            once = controllers["spectral@1"]
            there = spread(once["distance_to_reachable_goals"])
            if once["reachable"] < learned["reachable"]:
                there = f"{once['reachable']} of {once['goals']} goals, {there}"
            rows.append((f"{name}: one inverse step a goal, one update of the pose (`@1`)", "", there))
            rows.append(
                (
                    f"{name}: an inverse step, learned{' / FE-based' if fe else ''}, median",
                    "1 ms" if scene == "soft-gripper" else "",
                    " / ".join(f"{one['step_us']['median'] / 1e3:.2g}" for one in (learned, fe) if one) + " ms",
                )
            )
        rows.append((f"{scene}: sum of forces, of moments on the object", "1e-8", f"{one['object']['imbalance']:.1e}"))
    return markdown(("figure", "target", "measured"), rows)


def spread(distance: dict | None) -> str:
    return length(distance["mean"], distance["max"], digits=2) if distance else ""


def paper_meshes_table(f: dict) -> str:
    """The paper's three meshes: loss of the spectral model from 30 and 100 samples."""
    found = sorted(f["surrogates"]["meshes"].values(), key=lambda one: one["cells"])
    rows = [
        (str(one["cells"]), *(f"{point['samples']}: {point['loss']:.1e}" for point in one["curve"])) for one in found
    ]
    columns = max(len(row) for row in rows) - 1
    return markdown(("linear tetrahedra", *["samples: loss"] * columns), rows)


TABLES = {
    "readme": lambda f: readme_table(f["finger"], f["other_robot"]),
    "finger": lambda f: finger_table(f["finger"]),
    "surrogates": surrogates_table,
    "contact": contact_table,
    "paper-meshes": paper_meshes_table,
    "mechanics": mechanics_table,
    "profile": profile_table,
    "convergence": convergence_table,
    "meshes": meshes_table,
}
