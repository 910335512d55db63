"""One page of the measured robots: measured and computed shapes side by side, errors in mm, what the data support.

reality.py OUT ROBOT...: reads data/ROBOT/calibrated (and data/ROBOT/predicted where it is there), which `cfem
calibrate-cases` and `cfem predict-cases` made."""

import base64
import json
import sys
from dataclasses import dataclass
from html import escape
from pathlib import Path

from cfem.cases.outcome import shown
from cfem.report.page import Section, Summary, page
from cfem.report.tables import Table, number


@dataclass(frozen=True)
class Picture:
    """A PNG inside the page."""

    path: Path
    caption: str

    def html(self) -> str:
        data = base64.b64encode(self.path.read_bytes()).decode()
        caption = escape(self.caption)
        image = f'<img alt="{caption}" style="max-width:100%" src="data:image/png;base64,{data}">'
        return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def main() -> int:
    out, robots = Path(sys.argv[1]), sys.argv[2:]
    sections, lines = [], []
    for robot in robots:
        folder = Path("data") / robot
        result = json.loads((folder / "calibrated" / "calibration.json").read_text(encoding="utf-8"))
        kept = result["models"]["kept"]
        repeats = result["repeats_mm"]
        beside = (
            "no repeats were measured" if repeats is None else f"repeats of a load differ by up to {repeats:.1f} mm"
        )
        said = f"{kept['in_fit_mm']:.1f} mm in the fit, {kept['left_out_mm']:.1f} mm for cases left out of it"
        lines.append(f"{robot}: {said}; {beside}")
        parts = [
            Picture(folder / "calibrated" / "shapes.png", "Measured and computed, all cases in the fit"),
            parameters(result),
            errors(result),
            models(result),
        ]
        other = folder / "predicted" / "prediction.json"
        text = f"Mean distance over markers. {beside.capitalize()}. " + " ".join(result["untold"])
        sections.append(Section(robot, text, tuple(parts)))
        if other.exists():
            predicted = json.loads(other.read_text(encoding="utf-8"))
            if "mean_mm" in predicted:
                said = (
                    f"Error {predicted['mean_mm']:.1f} mm, mean over markers; "
                    f"{100 * predicted['coordinates_within']:.0f} % of coordinates within their 95 % intervals."
                )
                picture = Picture(folder / "predicted" / "shapes.png", "Predicted")
                sections.append(Section(f"{robot}: the table that predict.yaml names", said, (picture,)))
    out.mkdir(parents=True, exist_ok=True)
    text = page("Measured robots", Summary("; ".join(lines) + "."), None, None, sections)
    (out / "report.html").write_text(text, encoding="utf-8")
    print(f"{out / 'report.html'}: {len(robots)} robots")
    return 0


def parameters(result: dict) -> Table:
    rows = []
    for name, one in result["estimates"].items():
        value, unit = shown(one["value"], one["unit"])
        low, high = (shown(end, one["unit"])[0] for end in one["interval"])
        rows.append((name, number(value, 4), number(low, 4), number(high, 4), unit))
    return Table(("parameter", "value", "95 % from", "to", "unit"), rows)


def errors(result: dict) -> Table:
    markers = list(next(iter(result["errors_mm"].values())))
    head = ("case", *(f"{name}, mm" for name in markers), *(f"{name} left out, mm" for name in markers))
    rows = [
        (case, *(number(fitted[m]) for m in markers), *(number(result["left_out_mm"][case][m]) for m in markers))
        for case, fitted in result["errors_mm"].items()
    ]
    return Table(head, rows)


def models(result: dict) -> Table:
    head = ("model", "finds", "in the fit, mm", "left out, mm", "AICc", "BIC")
    rows = [
        (
            name,
            ", ".join(one["find"]),
            *(number(one[key]) for key in ("in_fit_mm", "left_out_mm")),
            *("–" if one[key] is None else f"{one[key]:.0f}" for key in ("aicc", "bic")),
        )
        for name, one in result["models"].items()
    ]
    return Table(head, rows)


if __name__ == "__main__":
    sys.exit(main())
