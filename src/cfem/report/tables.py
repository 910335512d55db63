"""Numbers of the manifests as tables that a person reads."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cfem.report.discretisation import label
from cfem.report.page import Table
from cfem.report.spec import Published

# Of a result of `cfem train`, all but these is what the kind of model chose for itself.
COMMON = {
    "kind", "form", "samples", "seconds_fit", "seconds_sampling", "microseconds_query", "errors", "history",
    "positive_definite", "learning_curve", "headline",
}  # fmt: skip


def number(value: float | None, digits: int = 3) -> str:
    """Three digits, powers of ten only where they help; a dash where there is none."""
    if value is None:
        return "–"
    if value != 0 and not 1e-3 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"
    return f"{value:.{digits}g}" if abs(value) < 1000 else f"{value:.0f}"


def _pair(spread: Mapping | None, unit: str = "") -> str:
    return "–" if spread is None else f"{number(spread['mean'])} / {number(spread['max'])}{unit}"


def loop_table(results: Mapping[str, Mapping[str, dict]]) -> Table:
    """One row a trajectory and controller of a run over time."""
    rows = []
    for trajectory, controllers in results.items():
        for name, result in controllers.items():
            wait = result["ticks_to_converge"]
            held = "–" if not wait else f"{number(wait['median'])} / {number(wait['max'])}"
            rows.append(
                (
                    trajectory,
                    name,
                    f"{result['reached']['mean']:g} of {result['goals']}",
                    number(result["seconds"]),
                    held,
                    _pair(result["error_at_goals"]),
                    _pair(result["error"]),
                    f"{number(result['step_us']['median'] / 1000)} / {number(result['step_us']['p99'] / 1000)}",
                )
            )
    return Table(
        (
            "trajectory",
            "controller",
            "goals reached",
            "time (s)",
            "ticks to stay there, median / max",
            "off when the next goal was due, mean / max (mm)",
            "off at every tick, mean / max (mm)",
            "CPU a tick, median / p99 (ms)",
        ),
        rows,
    )


def tracking_table(summaries: Mapping[str, Mapping[str, dict]]) -> Table:
    """One row a trajectory and controller."""
    rows = [
        (
            trajectory,
            name,
            f"{result['reachable']} of {result['goals']}",
            _pair(result["distance_to_reachable_goals"]),
            _pair(result["distance_to_fe_based"]),
            number(result["iterations_mean"], 2),
            f"{number(result['step_us']['median'] / 1000)} / {number(result['step_us']['p99'] / 1000)}",
            number(result["kkt_max"], 2),
        )
        for trajectory, controllers in summaries.items()
        for name, result in controllers.items()
    ]
    return Table(
        (
            "trajectory",
            "controller",
            "in reach",
            "to those goals, mean / max (mm)",
            "to FE-based, mean / max (mm)",
            "steps a goal",
            "step, median / p99 (ms)",
            "residual of the QP (mm)",
        ),
        rows,
    )


def model_table(
    models: Mapping[str, Mapping[str, Any]], published: Published | None = None, default: str | None = None
) -> Table:
    """One row a model, the published one last."""
    rows = [
        (
            f"{name} (default)" if name == default else name,
            str(results["samples"]),
            number(results["errors"]["loss"]),
            _pair(results["errors"]["tip_mm"]),
            _pair(results["errors"]["force_N"]),
            number(results["seconds_sampling"]),
            number(results["seconds_fit"]),
            number(results["microseconds_query"]),
        )
        for name, results in models.items()
    ]
    if published:
        samples = str(published.samples) if published.samples else "–"
        empty = ("–",) * 4
        rows.append((published.source, samples, number(published.loss), *empty, number(published.query_us)))
    return Table(
        (
            "model",
            "samples",
            "loss",
            "tip error, mean / max (mm)",
            "force error, mean / max (N)",
            "sampling (s of a core)",
            "training (s)",
            "query (µs)",
        ),
        rows,
    )


def definite_table(models: Mapping[str, Mapping[str, Any]]) -> Table:
    """One row a model: at how many random states between the samples its W is not positive definite."""
    rows = []
    for name, results in models.items():
        found = results["positive_definite"]
        s, p = found["where"]["s"], found["where"]["p"]
        unit = "N" if results.get("form") == "force" else "mm"
        where = f"({', '.join(number(value) for value in s)}) {unit}"
        where += f", p = ({', '.join(number(value) for value in p)})" if p else ""
        lacking = round(found["queries"] * (1 - found["share"]))
        smallest = number(found["smallest_eigenvalue"])
        rows.append((name, f"{lacking} of {found['queries']}", smallest, "" if found["share"] == 1 else where))
    head = (
        "model",
        "W not positive definite at",
        "smallest eigenvalue, W scaled to unit diagonal",
        "worst, at",
    )
    return Table(head, rows)


def choice_table(models: Mapping[str, Mapping[str, Any]]) -> Table:
    """What each model chose for itself: terms and weights of series, best epochs of networks."""
    rows = [(name, what, value) for name, results in models.items() for what, value in chosen(results)]
    return Table(("model", "chosen", "value"), rows)


def chosen(results: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What a model chose for itself and its value, for a reader: what it says of each of its quantities by itself, the
    rest in one."""

    def text(value: Any) -> str:
        if isinstance(value, list | tuple):
            return " ".join(text(one) for one in value)
        return number(value, 2) if isinstance(value, float) else str(value)

    def joined(facts: Mapping[str, Any]) -> str:
        return ", ".join(f"{name} {text(one)}".replace("_", " ") for name, one in facts.items())

    own = {name: value for name, value in results.items() if name not in COMMON}
    plain = {name: value for name, value in own.items() if not isinstance(value, dict)}
    for name, value in own.items():
        if parts := isinstance(value, dict) and {k: one for k, one in value.items() if not isinstance(one, dict)}:
            yield name, joined(parts)
    if plain:
        yield "", joined(plain)


def trust_table(found: Mapping[str, Mapping[str, Any]]) -> Table:
    """One row a model, of `cfem.report.surrogates.trust_summary`."""
    rows = [
        (
            name,
            f"{one['flagged']} of {one['states']}",
            f"{one['beyond_flagged']} of {one['beyond']}" if one["beyond"] else "–",
            _median(one["unflagged_mm"]),
            _median(one["flagged_mm"]),
            number(one["rank_correlation"], 2),
        )
        for name, one in found.items()
    ]
    return Table(
        (
            "model",
            "test states flagged",
            "states out of reach flagged",
            "tip error where not flagged, median / max (mm)",
            "where flagged, median / max (mm)",
            "rank correlation of error and distance",
        ),
        rows,
    )


def _median(spread: Mapping[str, float] | None) -> str:
    return "–" if spread is None else f"{number(spread['median'])} / {number(spread['max'])}"


def sampling_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """One row a model, method and number of training rows."""
    cells = [
        (
            f"{row['model']}, {row['method']}",
            str(row["samples"]),
            number(row["errors"]["loss"]),
            _pair(row["errors"]["tip_mm"]),
            _pair(row["errors"]["force_N"]),
            number(row["seconds_fit"]),
        )
        for row in rows
    ]
    head = (
        "model, method",
        "rows",
        "loss",
        "tip error, mean / max (mm)",
        "force error, mean / max (N)",
        "training (s)",
    )
    return Table(head, cells)


def sizes_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """One row a mesh and number of samples, of `cfem.report.studies.mesh_row`; control stands beside the last."""
    cells = []
    for row in rows:
        for point in row["curve"]:
            last = point is row["curve"][-1]
            control = (
                number(row["steps_learned"]),
                number(row["steps_fe"], 2),
                f"{number(row['missed_learned_mm'], 2)} / {number(row['missed_fe_mm'], 2)}",
            )
            cells.append(
                (
                    f"{row['name']}, {row['cells']} cells, {row['nodes']} nodes",
                    str(point["samples"]),
                    number(point["errors"]["loss"]),
                    _pair(point["errors"]["tip_mm"]),
                    number(point["samples"] / point["seconds_sampling"]),
                    *(control if last else ("", "", "")),
                )
            )
        published = row["published"]
        if published:
            cells.append(
                (
                    f"{row['name']}, {published['source']}",
                    str(published["samples"] or "–"),
                    number(published["loss"]),
                    *("",) * 5,
                )
            )
    return Table(
        (
            "mesh",
            "samples",
            "loss",
            "tip error, mean / max (mm)",
            "samples a second, one core",
            "steps a second, learned",
            "FE-based",
            "goals missed by, mean, learned / FE-based (mm)",
        ),
        cells,
    )


def discretisation_table(results: Sequence[dict]) -> Table:
    """One row a mesh and Poisson's ratio."""
    rows = [
        (
            label(row) + (" (reference)" if row["reference"] else ""),
            f"{row['poisson']:g}",
            str(row["nodes"]),
            number(row["W_11"]),
            number(100 * row["W"]),
            number(100 * row["tip"]),
            number(100 * row["force"]),
            number(row["factorizations"]),
            number(1e3 * row["sample_seconds"]),
            "yes" if row["front"] else "",
        )
        for row in results
    ]
    return Table(
        (
            "mesh",
            "nu",
            "nodes",
            "W of the first cable (mm/N)",
            "error of W (%)",
            "of the tip (%)",
            "of forces (%)",
            "factorisations, cold",
            "sample, CPU (ms)",
            "on the front",
        ),
        rows,
    )


def orders_table(orders: Sequence[dict]) -> Table:
    """One row a family of meshes."""
    rows = [
        (
            f"{row['element']}, {'graded' if row['graded'] else 'even'}"
            + ("" if row["radius"] is None else f", radius {row['radius']:g} mm"),
            f"{row['poisson']:g}",
            number(row["order"], 2),
        )
        for row in orders
    ]
    return Table(("meshes", "nu", "order of W's error in the cell size"), rows)


def tolerance_table(results: Sequence[dict]) -> Table:
    """One row a tolerance of the solver."""
    rows = [
        (
            number(row["tolerance"]),
            number(row["residual"]),
            number(row["tip_mm"]),
            number(row["W"]),
            str(row["iterations"]),
            str(row["factorizations"]),
            number(row["seconds"]),
        )
        for row in results
    ]
    return Table(
        ("tolerance", "residual", "tip error (mm)", "error of W", "iterations", "factorisations", "CPU (s)"), rows
    )


def provenance_table(manifests: Mapping[str, tuple[Path, dict]]) -> Table:
    """One row an artefact: what made it, from what, how long it took."""
    rows = [
        (
            name,
            f"cfem {manifest['stage']}",
            manifest["content"][:16],
            manifest["made_from"][:16],
            number(manifest["seconds"]),
        )
        for name, (_, manifest) in manifests.items()
    ]
    return Table(("artefact", "command", "content (SHA-256)", "made from", "seconds"), rows)


def versions_table(versions: Mapping[str, str]) -> Table:
    return Table(("package", "version"), list(versions.items()))
