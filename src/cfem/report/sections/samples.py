"""Section on samples: displacements and forces of the actuators, split by split."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cfem.core.artefact.content import artefact_file
from cfem.dataset.reader import Dataset, read_dataset
from cfem.report.chart import Chart, chart, panel
from cfem.report.page import ReportSection
from cfem.report.style import FE, INK, LEARNED


def read_splits(folder: Path, manifest: Mapping[str, Any]) -> dict[str, Dataset]:
    """Splits of an artefact of `cfem sample`, training first."""
    names = sorted((name for name in manifest["files"] if name.endswith(".parquet")), reverse=True)
    return {Path(name).stem: read_dataset(artefact_file(folder, name)) for name in names}


def units_of(data: Dataset) -> dict[str, tuple[str, str]]:
    """Units of the displacement and of the force of each actuator, by its name."""
    pairs = data.meta.get("row_units") or [("mm", "N")] * data.rows.n
    pairs_of_units = [(length.replace("^3", "³"), force) for length, force in pairs[-data.rows.n_a :]]
    return dict(zip(data.rows.actuators, pairs_of_units, strict=True))


def samples_section(splits: Mapping[str, Dataset], results: Mapping[str, Any]) -> ReportSection:
    """Section on the samples. results: of `cfem sample`."""
    rows = ", ".join(f"{count} {split}" for split, count in results["rows"].items())
    lost = f"all but {results['failed']} of them" if results["failed"] else "all of them"
    text = f"States solved by finite elements: {rows}; {lost} converged."
    return ReportSection("The samples", text, (coverage_chart(splits),), facts={"samples": results})


def coverage_chart(splits: Mapping[str, Dataset]) -> Chart:
    """Chart of the first two actuators in the plane of their displacements and of their forces; one actuator: force
    over displacement."""
    any_split = next(iter(splits.values()))
    names, units = any_split.rows.actuators, units_of(any_split)
    alone = len(names) == 1
    if alone:
        (length, force), name = units[names[0]], names[0]
        axes = [panel(f"{name}: force ({force})", f"displacement ({length})")]
    else:
        a, b = names[:2]
        axes = [panel(f"{b} ({units[b][kind]})", f"{a} ({units[a][kind]})") for kind in (0, 1)]
    for (split, data), colour in zip(splits.items(), (LEARNED[0], FE, LEARNED[1], LEARNED[2]), strict=False):
        train = split == "train"
        look = {"lw": 0, "marker": "o" if train else "x", "ms": 3.5 if train else 4, "color": colour}
        look["label"] = f"{split} ({len(data.delta_a)})"
        if alone:
            axes[0].plot(data.delta_a[:, 0], data.lambda_a[:, 0], **look)
            continue
        for axis, values in zip(axes, (data.delta_a, data.lambda_a), strict=True):
            axis.plot(values[:, 0], values[:, 1], **look)
        slack = data.slack.any(axis=1)
        if slack.any():
            ring = {"lw": 0, "marker": "o", "ms": 7, "mfc": "none", "color": INK}
            axes[0].plot(*data.delta_a[slack, :2].T, **ring, label="an actuator is slack")
    what = names[0] if alone else f"{names[0]} and {names[1]}"
    return chart("coverage", f"The solved states: displacements and forces of {what}.", axes)
