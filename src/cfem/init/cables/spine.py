"""The line along which a body is cut, from what is held to its tip: straight along an axis, or through its middle."""

from dataclasses import dataclass

import numpy as np

from cfem.init.body.interior import Interior
from cfem.init.body.section import Section, cut_across
from cfem.init.cables.centreline import Centreline
from cfem.init.hold import Run


@dataclass(frozen=True)
class Spine:
    """points (k, 3) mm; normals (k, 3), unit, across the cuts; follows: whether it follows the middle of the body, so
    that of each cut the piece there counts, and not the largest."""

    points: np.ndarray
    normals: np.ndarray
    follows: bool

    @property
    def length(self) -> float:
        """mm."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def at(self, share: float) -> tuple[np.ndarray, np.ndarray]:
        """The point and the normal (3,) after that share of the length."""
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])
        mixed = [[np.interp(share * along[-1], along, each) for each in rows.T] for rows in (self.points, self.normals)]
        return np.array(mixed[0]), np.array(mixed[1]) / np.linalg.norm(mixed[1])

    def section(self, body: Interior, share: float) -> Section | None:
        """The cut there; None where there is none."""
        place, normal = self.at(share)
        return cut_across(body, place, normal, place if self.follows else None)


def straight(run: Run) -> Spine:
    """Along the axis, over the free part."""
    axis = np.eye(3)[run.axis]
    return Spine(np.array([run.level * axis, run.tip * axis]), np.array([axis, axis]), False)


def along(line: Centreline) -> Spine:
    """Through the middle of the body."""
    return Spine(line.points, line.tangents, True)
