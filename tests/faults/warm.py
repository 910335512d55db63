"""Imported by the process that the killed ones are forked from: a dataset has been made, so that all is imported."""

import tempfile
from pathlib import Path

from faults.sampling import make

with tempfile.TemporaryDirectory() as folder:
    make(Path(folder) / "out")
