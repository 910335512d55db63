"""Models of one robot side by side: what their errors are, what they cost, how they learned."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cfem.condensed.mesh_error import mesh_error_of
from cfem.condensed.model_error import model_error_of
from cfem.core.console.shown import duration, length
from cfem.core.errors import InputError
from cfem.report.chart import Chart, chart, panel
from cfem.report.page import ReportSection
from cfem.report.sections.choices import QUANTITIES, choice_table
from cfem.report.sections.trust import Trust, trust_chart, trust_summary, trust_table
from cfem.report.spec import Published
from cfem.report.style import INK, LEARNED
from cfem.report.tables import ReportTable, lengths, loss, number, spread, tabulate

KINDS = {"spectral": LEARNED[0], "mlp": LEARNED[2]}
MARKS = "os^Dv"
FLOORS = {"loss": 1e-18, "tip": 1e-12, "force": 1e-12}  # smaller is nothing
ERRORS = {
    "loss": ("loss", lambda point: point["errors"]["loss"]),
    "tip": ("largest tip error (mm)", lambda point: point["errors"]["tip_mm"]["max"]),
    "force": ("largest force error ({})", lambda point: point["errors"]["force_N"]["max"]),
}
Models = Mapping[str, Mapping[str, Any]]  # results of `cfem train` by name


def trained(results: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Results of a train folder; InputError where it is of another stage or of a version that measured less."""
    complete = all("seconds_sampling" in point for point in results.get("learning_curve", [{}]))
    if not complete or "share" not in results.get("positive_definite", {}):
        raise InputError("holds no model that this version trained", where=str(folder), do="run cfem train on it")
    return dict(results)


def models_section(
    title: str,
    models: Models,
    trusts: Mapping[str, Trust],
    published: Published | None = None,
    default: str | None = None,
    prefix: str = "",
    force: str = "N",
) -> ReportSection:
    """Section on models. trusts: what the flags of each model are worth, where that was judged; prefix: of the names of
    the pictures; force: the unit of what the actuators carry."""
    summaries = {name: trust_summary(judged) for name, judged in trusts.items()}
    parts = [model_table(models, published, default, force)]
    parts += error_charts(models, published, default, prefix, force)
    parts += [definite_table(models), choice_table(models), training_chart(models, prefix)]
    if trusts:
        parts += [trust_chart(trusts, prefix), trust_table(summaries)]
    text = (
        "All errors are those at the test states, which no training has seen. The bound of the tip error holds in that "
        "share of further states in the model's domain. The paper's loss is the mean squared "
        "error of the entries of W and delta_free, each divided by its standard deviation over the test set. It "
        "depends on the axes of the scene. cfem train prints it, and judges the model by the same error of whole "
        "vectors, which does not. W is checked at random states between the samples."
    )
    facts = {"models": {name: dict(results) for name, results in models.items()}, "trust": summaries}
    return ReportSection(title, text, tuple(parts), facts)


def model_table(
    models: Models, published: Published | None = None, default: str | None = None, force="N"
) -> ReportTable:
    """Table of models, one a row, the published one last."""
    rows: list[tuple[str, Any]] = [(label(name, default), results) for name, results in models.items()]
    if published:
        empty = dict.fromkeys(("seconds_sampling", "seconds_fit"))
        errors = {"loss": published.loss, "tip_mm": None, "force_N": None}
        known = {"samples": published.samples or "–", "microseconds_query": published.query_us, "errors": errors}
        rows.append((published.source, {**empty, **known}))
    return tabulate(
        rows,
        {
            "model": lambda row: row[0],
            "samples": lambda row: str(row[1]["samples"]),
            "test states": lambda row: str(row[1]["errors"].get("states", "–")),
            "the paper's loss": lambda row: loss(row[1]["errors"]),
            "tip error, mean / max": lambda row: lengths(row[1]["errors"]["tip_mm"]),
            "tip error, bound": lambda row: _bound(row[1].get("model_error")),
            "the mesh adds (% of travel)": lambda row: _of_mesh(row[1].get("mesh_error")),
            f"force error, mean / max ({force})": lambda row: spread(row[1]["errors"]["force_N"]),
            "CPU time of sampling": lambda row: _time(row[1]["seconds_sampling"]),
            "training time": lambda row: _time(row[1]["seconds_fit"]),
            "one query": lambda row: _time(row[1]["microseconds_query"], 1e-6),
        },
    )


def _bound(error: Mapping[str, Any] | None) -> str:
    """Tip error that is not exceeded with the stated probability: '12 µm in 95 %'."""
    stated = model_error_of(error)
    return "–" if stated is None else f"{length(stated.tip.everywhere)} in {stated.percent}"


def _of_mesh(error: Mapping[str, Any] | None) -> str:
    """Between which shares the error of the mesh lies where the tip travels farthest."""
    known = mesh_error_of(error)
    return "–" if known is None else " to ".join(number(100 * share, 2) for share in known.tip.far)


def _time(value: float | None, unit: float = 1.0) -> str:
    return "–" if value is None else duration(unit * value)


def definite_table(models: Models) -> ReportTable:
    """Table of the models: at how many random states between the samples W is not positive definite."""

    def where(results: Mapping[str, Any]) -> str:
        definite = results["positive_definite"]
        if definite["share"] == 1:
            return ""
        unit = "N" if results.get("form") == "force" else "mm"
        p = definite["where"]["p"]
        place = f"({', '.join(number(value) for value in definite['where']['s'])}) {unit}"
        return place + (f", p = ({', '.join(number(value) for value in p)})" if p else "")

    def lacking(definite: Mapping[str, Any]) -> str:
        return f"{round(definite['queries'] * (1 - definite['share']))} of {definite['queries']}"

    return tabulate(
        models.items(),
        {
            "model": lambda row: row[0],
            "W not positive definite at": lambda row: lacking(row[1]["positive_definite"]),
            "smallest eigenvalue of W, its diagonal scaled to 1": lambda row: number(
                row[1]["positive_definite"]["smallest_eigenvalue"]
            ),
            "worst at": lambda row: where(row[1]),
        },
    )


def looks(models: Models) -> dict[str, dict[str, Any]]:
    """Look of each model: a colour a kind, a dashed line for models of forces, another mark where these are shared."""
    look_of, seen = {}, []
    for name, results in models.items():
        form = results.get("form", "displacement")
        twins = seen.count((results["kind"], form))
        seen.append((results["kind"], form))
        look_of[name] = {
            "color": KINDS.get(results["kind"], INK),
            "ls": "-" if form == "displacement" else "--",
            "marker": MARKS[twins % len(MARKS)],
            "mfc": "white" if form == "force" else None,
        }
    return look_of


def error_charts(
    models: Models, published: Published | None = None, default: str | None = None, prefix: str = "", force: str = "N"
) -> list[Chart]:
    """Charts of errors against samples, and against seconds where several models make that a comparison; a line joins a
    model's numbers of samples. Nothing where no model has three of them: the table says that."""
    if all(len(results["learning_curve"]) < 3 for results in models.values()):
        return []
    costs = {"samples": ("FE samples", lambda point: point["samples"])}
    if len(models) > 1:
        total = ("sampling and training (s)", lambda point: point["seconds_sampling"] + point["seconds_fit"])
        costs["total"] = total
    charts = []
    for cost, (cost_label, value) in costs.items():
        axes = []
        for measure, (error_label, error) in ERRORS.items():
            axis = panel(error_label.format(force), cost_label, log="xy")
            for name, look in looks(models).items():
                curve = sorted(models[name]["learning_curve"], key=lambda point: point["samples"])
                x, y = [value(point) for point in curve], [max(error(point), FLOORS[measure]) for point in curve]
                width = 2.2 if name == default else 1.3
                axis.plot(x, y, ms=5, lw=width, label=label(name, default), **look)
            if published and measure == "loss" and published.loss:
                _published(axis, cost, published)
            axes.append(axis)
        text = f"Errors at the test states against {cost_label}: each line is one model from more and more samples."
        charts.append(chart(f"{prefix}errors-{cost}", text, axes))
    return charts


def _published(axis, cost: str, published: Published) -> None:
    """Draws the published loss, at its own number of samples where that is known."""
    count = f", {published.samples} samples" if published.samples else ""
    look = {"color": INK, "label": published.source + count}
    if cost == "samples" and published.samples:
        axis.plot([published.samples], [published.loss], "*", ms=12, **look)
    else:
        axis.axhline(published.loss, ls=":", lw=1.2, **look)


def label(name: str, default: str | None) -> str:
    return f"{name} (default)" if name == default else name


def training_chart(models: Models, prefix: str = "") -> Chart:
    """Chart of the error of states held out, against terms or epochs. One panel a model."""
    axes = [
        (_terms if "terms" in results["history"][0] else _epochs)(name, results) for name, results in models.items()
    ]
    text = "Error at states held out while the models learn."
    if any("terms" in results["history"][0] for results in models.values()):
        text += (
            " Solid lines: the degree of the series counts alike along all input directions. Dashed lines: the "
            "directions have weights found by search; dotted lines: weights from the decay of the coefficients. A ring "
            "marks the number of terms chosen."
        )
    return chart(f"{prefix}training", text, axes)


def _terms(name: str, results: Mapping[str, Any]):
    """Panel of a model, a colour a quantity; solid where all coordinates count alike, dashed and dotted where their
    weights were searched for or are of a first fit; a ring marks what was chosen."""
    axis = panel(f"{name}: relative error", "terms", log="xy")
    for colour, quantity in zip(LEARNED, dict.fromkeys(row["quantity"] for row in results["history"]), strict=False):
        label_text = QUANTITIES.get(quantity, quantity)
        for weights, style in (("equal", "o-"), ("searched", "s--"), ("decay", "D:")):
            rows = [row for row in results["history"] if (row["quantity"], row["weights"]) == (quantity, weights)]
            if rows:
                terms, errors = [row["terms"] for row in rows], [row["error"] for row in rows]
                axis.plot(terms, errors, style, ms=2.5, lw=1.1, color=colour, label=label_text)
                label_text = None
        best = min((row for row in results["history"] if row["quantity"] == quantity), key=lambda row: row["error"])
        axis.plot(best["terms"], best["error"], "o", ms=9, mfc="none", color=colour)
    return axis


def _epochs(name: str, results: Mapping[str, Any]):
    """Panel of a network, a line a curve."""
    history = results["history"]
    axis = panel(f"{name}: standardised loss", "epoch", log="y")
    for curve, style, pale in (("training", "-", 0.55), ("validation", "--", 1.0)):
        epochs, losses = [row["epoch"] for row in history], [row[curve] for row in history]
        axis.plot(epochs, losses, style, lw=1.3, color=LEARNED[0], alpha=pale, label=curve)
    return axis
