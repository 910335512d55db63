"""The modes of a robot's surface: principal components of what its skeleton's states show of it.

Snapshots are, at the surface nodes and weighted by their shares of it: the displacements of every state; what one
standard deviation of each actuator's force adds to them, to first order; and, in a few of the states, how the surface
yields to forces on patches spread over it. Displacements decide, responses make the modes fit for contact and
vibration: HALF of the actuators' size, and a HUNDREDTH, in total, of all displacements for the patches.

How many modes are enough is judged by displacements of states that were left out, a quarter of them at a time."""

from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed.skin import Skin
from cfem.condensed.spread import spread
from cfem.constraint.surface import Surface
from cfem.sample.spec import SkinSpec

PATCHES, PROBED = 24, 6  # patches of the surface, and states in which they are pushed
HALF, HUNDREDTH = 0.5, 0.01
FOLDS = 4
TOLERANCE = 2e-4  # of the robot's length
NOTHING = 1e-9  # of the strongest mode: the share of one that is rounding


@dataclass(frozen=True)
class SkinSample:
    """Motion of the surface in one state, of m nodes: those of the surface, then those inside if they are asked for.

    displacements: (m, 3) mm
    by_force: (m, 3, n_a) mm/N
    forces: (n_a,) N
    yields: (m, 3, p) mm/N to forces on patches, None where they were not pushed"""

    displacements: np.ndarray
    by_force: np.ndarray
    forces: np.ndarray
    yields: np.ndarray | None = None


def probed(count: int) -> np.ndarray:
    """Numbers of the states, of `count` of a walk, that have their patches pushed."""
    return np.unique(np.linspace(0, count - 1, min(PROBED, count)).round().astype(int))


def patches(surface: Surface) -> Skin:
    """Mean positions of patches spread over the surface, x, y and z of each as a row: a skin to push at."""
    rest, middle = surface.rest, surface.rest.mean(axis=0)
    centres = spread(np.vstack([middle, rest]), 1 + min(PATCHES, len(rest) // 4), 0)[1:] - 1  # far from the middle too
    near = np.linalg.norm(rest[centres][:, None] - rest, axis=2)
    near /= np.minimum(near.min(axis=0), np.linalg.norm(rest - middle, axis=1)).max()
    bump = np.maximum(1 - near**2, 0) ** 2
    bump /= (bump @ surface.weights)[:, None]
    modes = np.einsum("pm,ij->pimj", bump, np.eye(3)).reshape(-1, len(rest), 3)
    return Skin(surface.nodes, rest, surface.triangles, surface.weights, modes, np.zeros((1, 2)))


@dataclass(frozen=True)
class Inside:
    """Nodes inside a body."""

    nodes: np.ndarray  # (p,) numbers of the nodes that are not of the surface
    rest: np.ndarray  # (p, 3) mm


def shown_nodes(surface: Surface, inside: Inside | None) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and places at rest (mm) of the nodes that `find_skin` wants to see."""
    if inside is None:
        return surface.nodes, surface.rest
    return np.concatenate([surface.nodes, inside.nodes]), np.concatenate([surface.rest, inside.rest])


def find_skin(
    surface: Surface, seen: list[SkinSample], spec: SkinSpec, length: float, inside: Inside | None = None
) -> Skin:
    """Skin with the modes that show the samples to the spec's tolerance. length: mm, of the robot; inside: the other
    nodes that `seen` has, None where it has none."""
    root, m = np.sqrt(np.maximum(surface.weights, 1e-12 / len(surface.weights))), len(surface.nodes)
    columns, state = _columns(seen, root)
    snapshots = (root[:, None, None] * columns[:m]).reshape(3 * m, -1)
    gram = snapshots.T @ snapshots
    most = spec.modes or spec.largest
    front = _front(snapshots, state, gram, root, len(seen), most)
    count = most
    if spec.modes is None:
        fine_enough = np.flatnonzero(front[1:, 1] <= (spec.tolerance or TOLERANCE * length))
        count = int(fine_enough[0]) + 1 if len(fine_enough) else most
    modes, mixes = _principal(snapshots, gram, np.arange(len(state)), count)
    modes = (modes / np.repeat(root, 3)[:, None]).T.reshape(-1, m, 3)
    skin = Skin(surface.nodes, surface.rest, surface.triangles, root**2, modes, front)
    if inside is None:
        return skin
    within = np.moveaxis(columns[m:] @ mixes, -1, 0)  # the same mixture of what the states show
    moved = np.array([sample.displacements for sample in seen])
    apart = np.linalg.norm(moved[:, m:] - np.tensordot(skin.rows(moved[:, :m]), within, axes=(1, 0)), axis=2)
    left_out = np.array([np.sqrt(np.mean(apart**2)), apart.max()])
    return replace(skin, inner_nodes=inside.nodes, inner_rest=inside.rest, inner_modes=within, inner_left=left_out)


def _columns(seen: list[SkinSample], root: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns (m, 3, c), the displacements of all states first, and the state (c,) that each column is of."""
    number = np.arange(len(seen))
    displaced = np.stack([sample.displacements for sample in seen], axis=-1)
    spread = np.std([sample.forces for sample in seen], axis=0)
    by_force = np.concatenate([HALF * spread * sample.by_force for sample in seen], axis=-1)
    pushed = [number for number, sample in enumerate(seen) if sample.yields is not None]
    columns, state = [displaced, by_force], [number, np.repeat(number, len(spread))]
    if pushed:
        yields = np.concatenate([seen[number].yields for number in pushed], axis=-1)
        m = len(root)
        size, reference = (np.linalg.norm(root[:, None, None] * columns_of[:m]) for columns_of in (yields, displaced))
        columns.append(yields * (HUNDREDTH * reference / size if size > 0 else 0.0))
        state.append(np.repeat(pushed, seen[pushed[0]].yields.shape[-1]))
    return np.concatenate(columns, axis=-1), np.concatenate(state)


def _principal(snapshots: np.ndarray, gram: np.ndarray, chosen: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal modes (3 m, k <= most) of the chosen columns, the strongest first, each with its largest entry
    positive; and the mixture (chosen, k) of the columns that each is."""
    sizes, mixes = np.linalg.eigh(gram[np.ix_(chosen, chosen)])
    sizes, mixes = sizes[::-1][:most], mixes[:, ::-1][:, :most]
    mixes = mixes[:, sizes > NOTHING**2 * max(sizes[0], np.finfo(float).tiny)]
    modes, upper = np.linalg.qr(snapshots[:, chosen] @ mixes)
    independent = np.abs(np.diag(upper)) > 0
    modes, mixes = modes[:, independent], mixes[:, independent] @ np.linalg.inv(upper[np.ix_(independent, independent)])
    largest = np.abs(modes).argmax(axis=0)
    sign = np.sign(modes[largest, np.arange(modes.shape[1])])
    return modes * sign, mixes * sign


def _front(
    snapshots: np.ndarray, state: np.ndarray, gram: np.ndarray, root: np.ndarray, states: int, most: int
) -> np.ndarray:
    """Errors (most + 1, 2) by the number of modes, as `Skin.front`."""
    square, largest = np.zeros(most + 1), np.zeros(most + 1)
    folds = min(FOLDS, states)
    for fold in range(folds):
        chosen = np.flatnonzero(state % folds != fold) if folds > 1 else np.arange(len(state))
        modes, _ = _principal(snapshots, gram, chosen, most)
        remainder = snapshots[:, fold:states:folds].copy()
        for count in range(most + 1):
            if 0 < count <= modes.shape[1]:
                mode = modes[:, count - 1]
                remainder -= np.outer(mode, mode @ remainder)
            apart = (remainder.reshape(len(root), 3, -1) ** 2).sum(axis=1)
            square[count] += apart.sum()
            largest[count] = max(largest[count], np.sqrt((apart / root[:, None] ** 2).max()))
    return np.column_stack([np.sqrt(square / states), largest])
