"""Forces on points of a learned robot."""

import numpy as np

from cfem.predict.contact.forces.loaded_robots import LoadedRobots


def put(robots: LoadedRobots, points: np.ndarray, forces: np.ndarray) -> None:
    """Puts forces (c, 3) N on points (c,), and takes all others off."""
    on_all = np.zeros_like(robots.free)
    on_all[points] = forces
    robots.know(points, on_all)


def compliance_of(robots: LoadedRobots, points: np.ndarray) -> np.ndarray:
    """(3 c, 3 c) mm/N of points (c,) without forces."""
    put(robots, points, np.zeros((len(points), 3)))
    return robots.compliance(under_forces=False)
