"""What docs/measured.md compares the rod of the pneumatic arm with.

python benchmarks/arm_baselines.py

    Polynomials of the pressure for each coordinate of each marker's displacement, fitted to the cases of
    pipelines/measured-arm/given.csv: mean distance (mm) from other.csv, by pressure (mbar), with the mean displacement
    (mm) beside it. rod: of data/measured-arm/predicted, where `make reality` has made it."""

import csv
import json
from pathlib import Path

import numpy as np

ARM = Path("pipelines/measured-arm")
PREDICTED = Path("data/measured-arm/predicted/predicted.csv")
DEGREES = {"linear": 1, "quadratic": 2, "cubic": 3}


def main() -> None:
    given, other = (_read(ARM / name) for name in ("given.csv", "other.csv"))
    rows: dict[str, dict] = {}
    for (case, marker), (pressure, moved) in other.items():
        row = rows.setdefault(case, {"pressure_mbar": pressure, "moved": []} | {name: [] for name in DEGREES})
        row["moved"].append(np.linalg.norm(moved))
        p, u = (np.array(part) for part in zip(*(one for (_, m), one in given.items() if m == marker), strict=True))
        for name, degree in DEGREES.items():
            row[name].append(np.linalg.norm(np.vander([pressure], degree + 1) @ np.polyfit(p, u, degree) - moved))
    if PREDICTED.exists():
        with open(PREDICTED, newline="", encoding="utf-8") as file:
            for line in csv.DictReader(file):
                rows[line["case"]].setdefault("rod", []).append(float(line["distance_mm"]))
    made = {
        case: {name: round(float(np.mean(numbers)), 2) for name, numbers in row.items()} for case, row in rows.items()
    }
    names = [name for name in (*DEGREES, "rod") if all(name in row for row in made.values())]
    made["mean"] = {name: round(float(np.mean([row[name] for row in made.values()])), 2) for name in names}
    print(json.dumps(made, indent=2))


def _read(path: Path) -> dict[tuple[str, str], tuple[float, np.ndarray]]:
    """Pressure and displacement, of the markers at the end."""
    with open(path, newline="", encoding="utf-8") as file:
        return {
            (f"{row['set']} {row['pressure_mbar']}", row["marker"]): (
                float(row["pressure_mbar"]),
                np.array([float(row[f"{a}_mm"]) - float(row[f"rest_{a}_mm"]) for a in "xyz"]),
            )
            for row in csv.DictReader(file)
            if row["marker"].startswith("tip")
        }


if __name__ == "__main__":
    main()
