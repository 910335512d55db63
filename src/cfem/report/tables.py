"""Numbers of the manifests as tables that a person reads."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cfem.report.discretisation import label
from cfem.report.page import Table
from cfem.report.spec import Published


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
            "KKT residual",
        ),
        rows,
    )


def model_table(models: Mapping[str, dict], published: Published | None) -> Table:
    """One row a model, the published one last."""
    rows = [
        (
            name,
            str(results["samples"]),
            number(results["errors"]["loss"]),
            _pair(results["errors"]["tip_mm"]),
            _pair(results["errors"]["force_N"]),
            number(results["seconds_fit"]),
            number(results["microseconds_query"]),
        )
        for name, results in models.items()
    ]
    if published:
        samples = str(published.samples) if published.samples else "–"
        rows.append((published.source, samples, number(published.loss), "–", "–", "–", number(published.query_us)))
    return Table(
        (
            "model",
            "samples",
            "loss",
            "tip error, mean / max (mm)",
            "force error, mean / max (N)",
            "fit (s)",
            "query (µs)",
        ),
        rows,
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
