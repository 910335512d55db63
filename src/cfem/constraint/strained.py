"""Rows that act on the strains of a rod, not on nodes."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Strained:
    """Of one row at strains e (m, 6): its value; by_e (m, 6), its derivative; second (m, 6, 6), None where the row is
    linear."""

    value: float
    by_e: np.ndarray
    second: np.ndarray | None = None
