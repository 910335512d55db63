"""Series of a robot's markers, skin and actuator forces at the reference values of its parameters.

They are costly to make, and other values of the parameters only shift and scale them: estimators of one robot with
other parameters share them."""

from functools import cached_property

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.estimation.force_series import ForceSeries
from cfem.predict.estimation.markers import on_triangles
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.protocol import Predictor
from cfem.predict.series.modes import ModeSeries


class ReferenceSeries:
    """Each series is made when it is first asked for.

    loaded_rows: (n_w,) numbers of the rows with unknown forces, effectors first, then modes of the skin
    """

    def __init__(self, model: Predictor, markers: np.ndarray, loaded: tuple[str, ...]):
        self._model, self._markers = model, markers
        names = model.rows.effectors + model.skin.names
        unknown = [name for name in loaded if name not in names]
        if unknown:
            raise InputError(f"the model has no row {unknown[0]!r}", do=f"known are {', '.join(names)}")
        self.loaded_rows = np.array([names.index(name) for name in loaded], dtype=int)

    @cached_property
    def nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights (m, n) of the surface's nodes, those of the triangle nearest to each marker; distances (m,) mm."""
        return on_triangles(self._markers, self._model.skin.rest, self._model.skin.triangles)

    @cached_property
    def marker_map(self) -> np.ndarray:
        """Matrix (3 m, k) from modes to displacements of the markers."""
        phi = np.einsum("mn,kni->mik", self.nearest[0], self._model.skin.modes)
        return phi.reshape(-1, phi.shape[2])

    @cached_property
    def markers(self) -> ModeSeries:
        """Displacements of the markers."""
        return self._modes(self.marker_map)

    @cached_property
    def modes(self) -> ModeSeries:
        """Amplitudes of the skin's modes."""
        return self._modes(np.eye(len(self._model.skin)))

    @cached_property
    def forces(self) -> ForceSeries:
        """Forces of the actuators. InputError of a model that is not spectral."""
        if not isinstance(self._model, SpectralPredictor):
            what = f"actuator forces need a model of kind spectral, got '{self._model.meta['kind']}'"
            raise InputError(what, do="leave the forces out, or train a spectral model")
        return ForceSeries.of(self._model, self.loaded_rows)

    def _modes(self, T: np.ndarray) -> ModeSeries:
        rows = self._model.rows
        return ModeSeries.of(self._model.skin, rows.n_a, T, rows.n_e, self.loaded_rows)
