"""Exports written as camera systems write them, of markers that rest, fall and settle."""

import csv

import numpy as np
from scipy.spatial.transform import Rotation

PLACES = {
    "base1": [6.0, -25.0, -16.0],
    "base2": [6.0, 25.0, 12.5],
    "base3": [6.0, 25.0, -15.0],
    "tip1": [100.0, 0.0, 21.0],
    "tip2": [100.0, -21.0, 9.0],
    "tip3": [100.0, 21.0, -9.0],
}
FALL = np.array([1.0, 0.5, -20.0])
TURN = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
SHIFT = np.array([300.0, -120.0, 800.0])


def motion(rate=100, noise=0.02, seed=0):
    """time (n,), points (n, 6, 3) mm in the cameras' frame: a second of rest, an oscillation, rest."""
    time = np.arange(4 * rate) / rate
    after = np.maximum(time - 1, 0)
    share = np.where(time < 1, 0, 1 - np.exp(-4 * after) * np.cos(2 * np.pi * 4 * after))
    places = np.array(list(PLACES.values()))
    moving = np.array([name.startswith("tip") for name in PLACES])
    points = places + share[:, None, None] * moving[:, None] * FALL
    points = (points - SHIFT) @ TURN  # so that TURN x + SHIFT leads back
    return time, points + noise * np.random.default_rng(seed).standard_normal(points.shape)


def write_optitrack(path, time, points, labels, unit="Meters"):
    size = {"Meters": 1e-3, "Millimeters": 1.0}[unit]
    about = ["Format Version", "1.23", "Take Name", "fall", "Export Frame Rate", "100", "Length Units", unit]
    wide = [label for label in labels for _ in range(3)]
    rows = [about, [], ["", "Type", *["Marker"] * len(wide)][: len(wide) + 2]]
    rows += [["", "Name", *wide], ["", "ID", *["7:0"] * len(wide)], ["", "", *["Position"] * len(wide)]]
    rows += [["Frame", "Time (Seconds)", *["X", "Y", "Z"] * len(labels)]]
    for i, (t, row) in enumerate(zip(time, size * points.reshape(len(time), -1), strict=True)):
        rows.append([i, f"{t:.4f}", *("" if np.isnan(n) else f"{n:.7f}" for n in row)])
    _write(path, rows)


def write_vicon(path, time, points, labels):
    rate = 1 / (time[1] - time[0])
    rows = [["Trajectories"], [f"{rate:g}"], ["", "", *(n for label in labels for n in (f"beam:{label}", "", ""))]]
    rows += [["Frame", "Sub Frame", *["X", "Y", "Z"] * len(labels)], ["", "", *["mm"] * 3 * len(labels)]]
    for i, row in enumerate(points.reshape(len(time), -1)):
        rows.append([i + 1, 0, *("" if np.isnan(n) else f"{n:.4f}" for n in row)])
    _write(path, [*rows, [], ["Model Outputs"]])


def write_c3d(path, time, points, labels):
    import c3d

    writer = c3d.Writer(point_rate=1 / (time[1] - time[0]))
    writer.set_point_labels(labels)
    for frame in points:
        rows = np.zeros((len(labels), 5), np.float32)
        rows[:, :3], rows[:, 3] = np.nan_to_num(frame), np.where(np.isfinite(frame).all(axis=1), 0, -1)
        writer.add_frames([(rows, np.zeros((0, 0)))])
    with open(path, "wb") as file:
        writer.write(file)


def _write(path, rows):
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows(rows)
