"""Tables of Markdown of elements, meshes and solvers, from the measured figures (docs/figures.json)."""

from markdown_table import markdown


def mechanics_table(f: dict) -> str:
    """The figures of the mechanics beside their targets."""
    study, suite, own, large = f["discretisation"], f["stability"], f["tours"]["own"], f["tours"]["large"]
    tours = {(row["cells"], row["solver"]): row for row in f["tours"]["paper"]}
    sizes = sorted({cells for cells, _ in tours})
    default = {row["poisson"]: row for row in study["meshes"] if is_default(row)}
    cost, linear, quadratic = cost_of_linear(study["meshes"])
    rows = [
        (
            "default mesh, error of W; of the tip; of cable forces, at nu = " + " / ".join(f"{nu:g}" for nu in default),
            "1 %",
            "; ".join(
                " / ".join(f"{100 * row[key]:.2f}" for row in default.values()) + " %" for key in ("W", "tip", "force")
            ),
            "`make discretisation`",
        ),
        (
            "best mesh of linear tetrahedra against the coarsest of tet10p0: CPU time per sample; error of W (nu 0.47)",
            "10 times at one error",
            f"{cost:.1f} times; {100 * linear:.0f} % against {100 * quadratic:.1f} %",
            "same",
        ),
        (
            f"samples per second, one core, 1000 samples, tet4 {' / '.join(map(str, sizes))}: rslab",
            "50 / 10 / 4",
            " / ".join(f"{tours[n, 'rslab']['samples_per_second']:.3g}" for n in sizes),
            "`benchmarks/tour.py`",
        ),
        (
            "the same with PARDISO (`pip install cfem[fast]`), 300 samples",
            "100 / 20 / 7",
            " / ".join(f"{tours[n, 'pardiso']['samples_per_second']:.3g}" for n in sizes),
            "same",
        ),
        (
            "factorisations per sample: those meshes; default mesh, 100 samples; nu = 0.499, 300 samples",
            "1.1; 3; 1.1",
            " / ".join(f"{tours[n, 'rslab']['factorizations_per_sample']:.2f}" for n in sizes)
            + f"; {own[0]['factorizations_per_sample']:.2f}; {own[1]['factorizations_per_sample']:.2f}",
            "same",
        ),
        (
            "time per sample divided by the time of its numeric factorisations: those meshes; default mesh",
            "2.5 from 8895 on",
            " / ".join(f"{tours[n, 'rslab']['time_over_bound']:.2g}" for n in sizes)
            + f"; {own[0]['time_over_bound']:.2g}",
            "same",
        ),
        (
            f"a body of {large['cells']} tet4: samples per second, memory",
            "it samples",
            f"{large['samples_per_second']:.2g}, {large['memory_mib'] / 1024:.1f} GiB",
            "same",
        ),
        (
            f"stability suite, {suite['cases']} cases: correct",
            "100 %",
            f"{suite['right']} ({suite['seconds']:.0f} s)",
            "`cfem stability`",
        ),
    ]
    return markdown(("figure", "target", "measured", "command"), rows)


def is_default(row: dict) -> bool:
    return row["element"] == "tet10p0" and row["graded"] and 6000 < row["cells"] < 9000 and not row["reference"]


def cost_of_linear(rows: list[dict]) -> tuple[float, float, float]:
    """CPU seconds a sample of the most exact mesh of linear tetrahedra over those of tet10p0's coarsest graded one, and
    both errors of W, at nu 0.47."""
    mine = [row for row in rows if row["poisson"] == 0.47 and not row["reference"] and row["radius"] is None]
    linear = min((row for row in mine if row["element"] == "tet4"), key=lambda row: row["W"])
    graded = [row for row in mine if row["element"] == "tet10p0" and row["graded"]]
    coarse = min(graded, key=lambda row: row["cells"])
    return linear["sample_seconds"] / coarse["sample_seconds"], linear["W"], coarse["W"]


def profile_table(f: dict) -> str:
    """Where a sample's time goes."""
    rows = []
    tours = f["tours"]
    parts = list(tours["paper"][0]["ms_per_sample"])
    for row in (*tours["paper"], tours["own"][0], tours["large"]):
        shown = (row["element"], str(row["cells"]), str(row["unknowns"]), row["solver"])
        rows.append(
            (*shown, *(f"{row['ms_per_sample'].get(name, 0):.3g}" for name in parts), f"{row['time_over_bound']:.2g}")
        )
    head = ("element", "cells", "unknowns", "solver", *(f"{name} (ms)" for name in parts), "time / factorisations")
    return markdown(head, rows)


def convergence_table(f: dict) -> str:
    """Orders by manufactured solutions."""
    found = f["convergence"]
    rows = [
        (
            row["element"],
            row["law"],
            f"{row['poisson']:g}",
            row["held"],
            " / ".join(map(str, row["divisions"])),
            *(" / ".join(f"{order:.2f}" for order in row[key]) for key in ("L2_orders", "H1_orders")),
        )
        for row in (*found["neo_hookean"], *found["other_laws"])
    ]
    return markdown(("element", "law", "nu", "held", "cells per edge", "orders in L2", "orders in H1"), rows)


def meshes_table(f: dict) -> str:
    """The study of meshes at every ratio: error of W in per cent, and CPU milliseconds a sample."""
    study = f["discretisation"]["meshes"]
    ratios = sorted({row["poisson"] for row in study})
    rows = {}
    for row in study:
        name = f"{row['element']}, {row['cells']}, {'graded' if row['graded'] else 'even'}"
        rows.setdefault(name + (" (reference)" if row["reference"] else ""), {})[row["poisson"]] = row
    lines = [
        (
            name,
            *(f"{100 * found[nu]['W']:.2g}" for nu in ratios),
            *(f"{100 * found[nu]['tip']:.2g}" for nu in (ratios[0], ratios[-1])),
            f"{1e3 * found[ratios[0]]['sample_seconds']:.0f}",
            "yes" if found[ratios[len(ratios) // 2]]["front"] else "",
        )
        for name, found in rows.items()
    ]
    head = (
        "mesh",
        *(f"W, nu {nu:g} (%)" for nu in ratios),
        *(f"tip, nu {nu:g} (%)" for nu in (ratios[0], ratios[-1])),
        "sample, CPU (ms)",
        "on the front",
    )
    return markdown(head, lines)
