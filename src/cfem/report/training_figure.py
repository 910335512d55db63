"""How models learned: held-out error against degree or epoch, test error against samples and against time of a
query."""

from cfem.report.spec import Published
from cfem.report.style import FAINT, LEARNED, outside_legend, panels, plain_ticks, png


def training_figure(models: dict[str, dict]) -> bytes:
    """models: name -> results of `cfem train`. One panel a model."""
    figure, axes = panels(len(models), height=3.4)
    for (name, results), axis in zip(models.items(), axes, strict=True):
        history = results["history"]
        if results["kind"] == "spectral":
            for colour, quantity in zip(LEARNED, dict.fromkeys(row["quantity"] for row in history), strict=False):
                rows = [row for row in history if row["quantity"] == quantity]
                axis.semilogy(
                    [r["degree"] for r in rows],
                    [r["error"] for r in rows],
                    "o-",
                    ms=3,
                    color=colour,
                    label=quantity.replace("_", " "),
                )
            axis.set(xlabel="polynomial degree", ylabel="held-out error, relative")
        else:
            for colour, curve in zip(LEARNED, ("training", "validation"), strict=False):
                axis.semilogy([r["epoch"] for r in history], [r[curve] for r in history], color=colour, label=curve)
            axis.set(xlabel="epoch", ylabel="loss, standardised")
        outside_legend(axis)
        axis.set_title(f"{name}, {results['samples']} samples", pad=22)
    return png(figure)


def learning_figure(models: dict[str, dict], published: Published | None) -> bytes:
    """Loss and largest tip error on the test set, against training samples."""
    figure, axes = panels(2, height=3.6)
    for colour, (name, results) in zip(LEARNED, models.items(), strict=False):
        curve = sorted(results["learning_curve"], key=lambda point: point["samples"])
        samples = [point["samples"] for point in curve]
        axes[0].loglog(samples, [p["errors"]["loss"] for p in curve], "o-", ms=4, color=colour, label=name)
        axes[1].loglog(samples, [p["errors"]["tip_mm"]["max"] for p in curve], "o-", ms=4, color=colour, label=name)
    if published and published.loss:
        axes[0].axhline(published.loss, color=FAINT, ls="--", lw=1.2)
        many = f", {published.samples} samples" if published.samples else ""
        axes[0].annotate(
            published.source + many,
            (0.98, published.loss),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="bottom",
            fontsize=9,
        )
    axes[0].set(xlabel="training samples", ylabel="loss on the test set", title="the paper's loss")
    axes[1].set(xlabel="training samples", ylabel="mm", title="largest tip error on the test set")
    axes[1].legend()
    for axis in axes:
        plain_ticks(axis.xaxis)
    return png(figure)


def inference_figure(models: dict[str, dict], published: Published | None) -> bytes:
    """Loss and largest tip error against the time of one query."""
    figure, axes = panels(2, height=3.4)
    for colour, (name, results) in zip(LEARNED, models.items(), strict=False):
        place = results["microseconds_query"]
        for axis, value in zip(axes, (results["errors"]["loss"], results["errors"]["tip_mm"]["max"]), strict=True):
            axis.loglog(place, value, "o", ms=9, color=colour)
            axis.annotate(
                f"{name}, {results['samples']} samples", (place, value), xytext=(9, 6), textcoords="offset points"
            )
            axis.margins(0.45)
    if published and published.loss:
        axes[0].axhline(published.loss, color=FAINT, ls="--", lw=1.2, label=published.source)
        axes[0].legend(loc="upper left")
    axes[0].set(xlabel="one query (µs)", ylabel="loss on the test set", title="loss against run time")
    axes[1].set(xlabel="one query (µs)", ylabel="mm", title="largest tip error against run time")
    for axis in axes:
        plain_ticks(axis.xaxis)
    return png(figure)
