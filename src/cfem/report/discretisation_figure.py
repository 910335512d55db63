"""Pictures of a discretisation study."""

from collections.abc import Sequence

from cfem.report.style import FAINT, LEARNED, outside_legend, panels, png

_MARKS = ("o", "s", "^", "D")


def front_figure(rows: Sequence[dict], poisson: float) -> bytes:
    """Error of W and of the tip against CPU seconds a sample at one Poisson's ratio; the reference is left out."""
    figure, axes = panels(2, width=9.0, height=3.9)
    mine = [row for row in rows if row["poisson"] == poisson and not row["reference"] and row["radius"] is None]
    kinds = list(dict.fromkeys((row["element"], row["graded"]) for row in mine))
    for axis, key in zip(axes, ("W", "tip"), strict=True):
        for index, (element, graded) in enumerate(kinds):
            line = sorted(
                (row for row in mine if (row["element"], row["graded"]) == (element, graded)),
                key=lambda row: row["sample_seconds"],
            )
            colour = LEARNED[index % len(LEARNED)]
            x, y = ([row["sample_seconds"] for row in line], [100 * row[key] for row in line])
            name = f"{element}, {'graded' if graded else 'even'}"
            axis.loglog(x, y, "-", color=colour, lw=1, alpha=0.5)
            axis.loglog(x, y, _MARKS[index % 4], ms=7, color=colour, mfc="white", label=name)
            front = [row for row in line if row["front"]]
            axis.loglog(
                [row["sample_seconds"] for row in front],
                [100 * row[key] for row in front],
                _MARKS[index % 4],
                ms=7,
                color=colour,
            )
        axis.axhline(1.0, color=FAINT, lw=1, ls="--")
        axis.set(xlabel="one sample, CPU (s)", ylabel="%")
    axes[0].set_title(f"error of W (filled: on the front), nu {poisson:g}", pad=34)
    axes[1].set_title("error of the tip", pad=34)
    outside_legend(axes[0], columns=3)
    return png(figure)


def poisson_figure(rows: Sequence[dict]) -> bytes:
    """Error of W against 1 - 2 nu, a line a mesh."""
    figure, (axis,) = panels(1, width=7.5, height=3.9)
    mine = [row for row in rows if not row["reference"] and row["radius"] is None]
    kinds = list(dict.fromkeys((row["element"], row["graded"]) for row in mine))
    for index, (element, graded) in enumerate(kinds):
        family = [row for row in mine if (row["element"], row["graded"]) == (element, graded)]
        cells = sorted({row["cells"] for row in family})
        for place, count in enumerate(cells):
            line = sorted((row for row in family if row["cells"] == count), key=lambda row: row["poisson"])
            axis.semilogy(
                range(len(line)),
                [100 * row["W"] for row in line],
                "-" + _MARKS[index % 4],
                color=LEARNED[index % len(LEARNED)],
                alpha=0.35 + 0.65 * (place + 1) / len(cells),
                ms=5,
                label=f"{element}, {'graded' if graded else 'even'}" if place == len(cells) - 1 else None,
            )
    ratios = sorted({row["poisson"] for row in mine})
    axis.set_xticks(range(len(ratios)), [f"{nu:g}" for nu in ratios])
    axis.axhline(1.0, color=FAINT, lw=1, ls="--")
    axis.set(xlabel="Poisson's ratio", ylabel="%")
    axis.set_title("error of W (paler: coarser)", pad=34)
    outside_legend(axis, columns=3)
    return png(figure)
