"""One page of the measured robots: measured and computed shapes side by side, errors in mm beside the scatter of the
repeats, what the data support.

reality.py OUT ROBOT...: reads data/ROBOT/calibrated (and data/ROBOT/predicted, where it holds cases that were not in
the fit), which `cfem calibrate-cases` and `cfem predict-cases` made."""

import base64
import json
import sys
from dataclasses import dataclass
from html import escape
from pathlib import Path
from statistics import mean

from cfem.core.artefact.judgement import sentences
from cfem.identify.cases.text import shown
from cfem.report.page import ReportSection, Summary, page
from cfem.report.tables import ReportTable, number

TITLES = {
    "measured-beam": "Silicone beam (ETH Zurich)",
    "measured-tentacle": "Tentacle with two tendons (TU Delft)",
    "measured-arm": "Pneumatic arm (ETH Zurich)",
}


@dataclass(frozen=True)
class Picture:
    """A PNG inside the page, in a box that scrolls where the screen is narrow."""

    path: Path
    caption: str

    def html(self) -> str:
        data = base64.b64encode(self.path.read_bytes()).decode()
        caption = escape(self.caption)
        image = (
            f'<img alt="{caption}" style="display:block;width:100%;min-width:720px" src="data:image/png;base64,{data}">'
        )
        return f'<figure><div class="scroll" tabindex="0">{image}</div><figcaption>{caption}</figcaption></figure>'


def main() -> int:
    out, robots = Path(sys.argv[1]), sys.argv[2:]
    sections, lines = [], []
    for robot in robots:
        folder, title = Path("data") / robot, TITLES.get(robot, robot)
        result = json.loads((folder / "calibrated" / "calibration.json").read_text(encoding="utf-8"))
        doubts = [f"{one}." for one in sentences(result)]
        lines.append(" ".join([f"{title}: {outcome(result)}.", *doubts]))
        parts = []
        if (folder / "calibrated" / "shapes.png").exists():
            caption = "Each case as the calibration by the other cases predicts it, with 95 % intervals of the markers."
            parts.append(Picture(folder / "calibrated" / "shapes.png", caption))
        parts += [errors(result), parameters(result), models(result)]
        untold = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in result["untold"]]
        text = " ".join([*doubts, f"{outcome(result)[0].upper()}{outcome(result)[1:]}.", *untold])
        sections.append(ReportSection(title, text, tuple(parts)))
        other = folder / "predicted" / "prediction.json"
        if other.exists():
            predicted = json.loads(other.read_text(encoding="utf-8"))
            if "mean_mm" in predicted and not predicted["in_fit"]:
                said = " ".join(f"{one}." for one in sentences(predicted)) + (
                    f" Error {predicted['mean_mm']:.1f} mm, mean over markers; "
                    f"{100 * predicted['coordinates_within']:.0f} % of coordinates within their 95 % intervals."
                )
                picture = Picture(folder / "predicted" / "shapes.png", "Predicted")
                sections.append(ReportSection(f"{title}: cases that were not in the fit", said, (picture,)))
    out.mkdir(parents=True, exist_ok=True)
    text = page("Measured robots", Summary(" ".join(lines)), None, None, sections)
    text = text.replace("<details id", "<details open id")
    (out / "report.html").write_text(text, encoding="utf-8")
    print(f"{out / 'report.html'}: {len(robots)} robots")
    return 0


def outcome(result: dict) -> str:
    """In one sentence."""
    kept, repeats = result["models"]["kept"], result["repeats_mm"]
    said = []
    if kept["left_out_mm"] is not None:
        said.append(f"a case that the fit has not seen is {kept['left_out_mm']:.1f} mm off (mean over markers)")
    coordinates, markers = result["left_out_within"]
    if coordinates is not None:
        said.append(f"{100 * markers:.0f} % of its markers lie within their 95 % radius")
    said.append(f"cases in the fit are {kept['in_fit_mm']:.1f} mm off")
    if repeats is None:
        said.append("no load was measured twice")
    else:
        said.append(f"repeats of a load differ by up to {repeats:.1f} mm")
    return "; ".join(said)


def parameters(result: dict) -> ReportTable:
    rows = []
    for name, one in result["estimates"].items():
        value, unit = shown(one["value"], one["unit"])
        low, high = (shown(end, one["unit"])[0] for end in one["interval"])
        rows.append((name, number(value, 4), number(low, 4), number(high, 4), unit))
    return ReportTable(("parameter", "value", "95 % from", "to", "unit"), rows)


def errors(result: dict) -> ReportTable:
    """Of each case that the fit has not seen, beside that in the fit and what repeats of its load differ by."""
    markers = list(next(iter(result["left_out_mm"].values())))
    repeats = result.get("repeats_by_case_mm", {})
    head = ("error of an unseen case, mm", *markers, "mean", "in the fit", "its repeats differ by")
    rows = []
    for case, found in result["left_out_mm"].items():
        means = [[e for e in each.values() if e is not None] for each in (found, result["errors_mm"][case])]
        middle = [number(mean(each)) if each else "–" for each in means]
        rows.append((case, *(number(found[m]) for m in markers), *middle, number(repeats.get(case))))
    return ReportTable(head, rows)


def models(result: dict) -> ReportTable:
    head = ("model", "parameters found", "in the fit, mm", "unseen, mm", "AICc", "BIC")
    rows = [
        (
            name,
            ", ".join(one["find"]),
            *(number(one[key]) for key in ("in_fit_mm", "left_out_mm")),
            *("–" if one[key] is None else f"{one[key]:.0f}" for key in ("aicc", "bic")),
        )
        for name, one in result["models"].items()
    ]
    return ReportTable(head, rows)


if __name__ == "__main__":
    sys.exit(main())
