"""A model whose folder may be replaced while it is in use: the last good one answers."""

from pathlib import Path
from typing import Any

from cfem.core.errors import InputError
from cfem.predict.load import Runtime, load_model, stamp
from cfem.predict.protocol import Predictor


class LiveModel:
    """As the `Predictor` in the folder, now. `refresh` takes up one that has replaced it, skin and all, or keeps the
    one before where that is of another robot or damaged. taken: how many have been taken up."""

    def __init__(self, folder: Path, runtime: Runtime = "arrays"):
        self._folder, self._runtime, self.taken = folder, runtime, 0
        self._stamp, self.now = self._read()

    def __getattr__(self, name: str) -> Any:
        return getattr(vars(self)["now"], name)

    def refresh(self) -> bool:
        """Takes up the folder's model if it was replaced; True where another model answers from now on. Looks at one
        file where nothing has changed."""
        if stamp(self._folder) in (self._stamp, None):
            return False
        try:
            self._stamp, model = self._read()
        except InputError:
            return False
        names = [[parameter.name for parameter in version.parameters] for version in (model, self.now)]
        if model.rows != self.now.rows or names[0] != names[1]:
            return False
        self.now, self.taken = model, self.taken + 1
        return True

    def _read(self) -> tuple[Any, Predictor]:
        version = stamp(self._folder)  # one that is replaced while it is read is looked at again next time
        return version, load_model(self._folder, self._runtime, whole=True)
