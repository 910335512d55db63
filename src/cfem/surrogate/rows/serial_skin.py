"""The skins of modules, taken over by a model of modules in a row, and judged by the surface of the whole."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cfem.condensed.skin import read_skin
from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.files import write_npz
from cfem.dataset.schema import SKIN
from cfem.predict.load import has_skin, read_arrays, skins_of
from cfem.predict.rows.serial import SerialPredictor, joined
from cfem.predict.rows.serial_skin import FILE, SAME
from cfem.predict.series.skin import FILE as OF_MODULE
from cfem.surrogate.rows.serial import folders
from cfem.surrogate.spec import SerialSpec


def add_serial_skin(
    folder: Path, predictor: SerialPredictor, spec: SerialSpec, test: Any, dataset_folder: Path
) -> dict[str, Any] | None:
    """Writes the modules' skins into the folder. Results for the manifest: errors at those nodes of the dataset's
    surface that are nodes of the row at rest. None where a module has no skin, the dataset has none, or no node is
    the same; in the last two cases the model still has a shape, which nobody has judged."""
    if not all(map(has_skin, folders(spec))):
        return None
    arrays = joined([read_arrays(path, OF_MODULE) for path in folders(spec)])
    write_npz(folder / FILE, arrays)
    predictor.skin_source = lambda: skins_of(predictor, arrays)
    if test.with_skin is None:
        return None
    true = read_skin(artefact_file(dataset_folder, SKIN))
    distance, nearest = cKDTree(predictor.surface.rest).query(true.rest)
    same = np.flatnonzero(distance <= SAME * predictor.length)
    if not len(same):
        return None
    places = true.rest + true.displacements(test.with_skin.delta_s)
    apart = np.linalg.norm(predictor.shape(test.delta_a)[:, nearest[same]] - places[:, same], axis=2)
    weights, (left_rms, left_max) = true.weights[same] / true.weights[same].sum(), test.with_skin.left.T
    rms = float(np.sqrt(np.mean(apart**2 @ weights + left_rms**2)))
    largest = float((apart.max(axis=1) + left_max).max())
    return {
        "modes": max(map(len, predictor.surface.modules)),
        "of": f" of each of {len(predictor.surface.modules)} modules",
        "nodes": len(same),
        "rms_mm": rms,
        "largest_mm": largest,
        "largest_percent_of_length": 100 * largest / predictor.length,
    }
