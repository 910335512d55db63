"""Pairs of a patch and the soft surface before it, and of rigid obstacles and the surface between its nodes
(`cfem.contact.between_nodes`), in the rounds of a step (`cfem.predict.contact.step.rounds`): which touch, from where
they slip, and whether they have settled."""

import numpy as np

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import Memory, Pairs
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.bodies import Bodies
from cfem.predict.contact.step.state import ContactState

SETTLED = 1e-8  # of the length: the last step of patches that touch soft surfaces
OVERLAP = 1e-6  # of the length: how far a patch may be within a surface that it does not touch
NEAR = 0.1  # distances of patches: of pairs that are farther apart nothing local is known in the next step


class SoftPairs:
    """Pairs of soft surfaces, and of obstacles between nodes, during one step.

    pairs: that are near each other
    touching: those of the law of this round
    push: (3,) N by slot of those that are pressed
    memory: from where slip counts
    step: mm by which patches last moved"""

    def __init__(
        self,
        robots: LoadedRobots,
        scene: Bodies,
        obstacles: ObstacleSet,
        before: ContactState | None,
        places: np.ndarray,
    ):
        """Begins with the pairs of the state `before`, None: with those that are near at places (N, 3) mm."""
        self.obstacles = obstacles
        self.robots, self.scene, self.surroundings, self.length = robots, scene, scene.surroundings, scene.length
        self.memory, self.push, self.step = Memory(), {}, np.inf
        self.touching, self._settled_slots = Pairs.none(len(places)), frozenset()
        self._faces: dict[int, np.ndarray] = {}  # of what has touched in this step
        self._touched: set[int] = set()  # slots, in this step
        self._slid: dict[int, np.ndarray] = {}
        self._begin = None if before is None else before.places
        if before is None:
            self.detect(places)
            return
        pressed = before.push.any(axis=1) & ~before.on_obstacles
        self.memory, self.push = before.memory, _by_slot(before.pairs.slots[pressed], before.push[pressed])
        self.pairs = before.pairs.some(~before.on_obstacles)
        self.onwards(places)

    def detect(self, places: np.ndarray) -> None:
        """Finds the pairs anew, of patches at places (N, 3) mm."""
        pairs = Pairs.none(len(places))
        if self.surroundings.may_meet is not None:
            normals = self.scene.normals(self.robots.rows, self.robots.R)
            pairs = self.surroundings.pairs(places, normals, self._faces, self.step)
        self.pairs = self._with_obstacles(pairs, places)

    def onwards(self, places: np.ndarray) -> None:
        """Moves the same pairs along with patches to places (N, 3) mm."""
        self.pairs = self._with_obstacles(self.surroundings.onwards(self.pairs, places), places)

    def _with_obstacles(self, soft: Pairs, places: np.ndarray) -> Pairs:
        """Pairs of soft surfaces, and those of obstacles between nodes at places (N, 3) mm."""
        if not self.scene.meets_between_nodes:
            return soft
        return soft.joined(self.surroundings.between_nodes(places, self.obstacles, self._touched))

    def touch(self, places: np.ndarray) -> Pairs:
        """Those that touch or are pressed."""
        pressed = np.array([slot in self.push for slot in self.pairs.slots.tolist()], dtype=bool)
        return self.pairs.some(((self.pairs.gaps <= 0) | pressed) & self._entered(places))

    def take(self, touching: Pairs, places: np.ndarray) -> None:
        """The pairs that are part of the law of this round."""
        self.touching = touching
        self.memory = self.memory.with_new(touching, self._begin, places)
        self._faces |= touching.faces
        self._touched.update(touching.slots.tolist())

    def gaps(self, places: np.ndarray, mu: float) -> np.ndarray:
        """(p, 3) mm of those that touch: normal gap, and slip in their frames."""
        slips = self.memory.slips(self.touching, places) if mu else np.zeros((len(self.touching), 2))
        return np.column_stack([self.touching.gaps, slips])

    def at_begin(self, origin: ContactState, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gaps and slips (p, 3) mm, and forces (p, 3) N, of those that touch, at places (N, 3) mm, in the
        state `origin`."""
        pairs, pressed = self.touching, ~origin.on_obstacles
        normal = pairs.gaps_at(places, origin.places)
        push = _by_slot(origin.pairs.slots[pressed], origin.push[pressed])
        forces = np.array([push.get(slot, np.zeros(3)) for slot in pairs.slots.tolist()]).reshape(-1, 3)
        return np.column_stack([normal, self.memory.slips(pairs, origin.places)]), forces

    def slide(self, slid: np.ndarray) -> None:
        """Those that touch have slid by (p, 3) mm before the last part of the step."""
        self._slid = _by_slot(self.touching.slots, slid)

    def push_of(self, pairs: Pairs) -> np.ndarray:
        """(p, 3) N."""
        return np.array([self.push.get(slot, np.zeros(3)) for slot in pairs.slots.tolist()]).reshape(-1, 3)

    def press(self, push: np.ndarray, step: float) -> None:
        """Those that touch are pressed by push (p, 3) N; step: mm, by which all of the law's answer moves patches."""
        pressed = push.any(axis=1)
        self.push, self.step = _by_slot(self.touching.slots[pressed], push[pressed]), step

    def settled(self, places: np.ndarray, on_obstacles: np.ndarray) -> bool:
        """True where what touches, on_obstacles (k,) patches too, is what did in the last round, and hardly moves any
        more."""
        slots = frozenset([*self.touching.slots.tolist(), *(on_obstacles + len(places)).tolist()])
        same, self._settled_slots = slots == self._settled_slots, slots
        opened = ~np.isin(self.pairs.slots, list(slots)) & self._entered(places)
        clear = self.pairs.gaps[opened].min(initial=np.inf) >= -OVERLAP * self.length
        return same and clear and self.at_rest(self.step)

    def at_rest(self, step: float) -> bool:
        """True where patches hardly move: by `step` mm."""
        return step <= SETTLED * self.length

    def apart(self, places: np.ndarray) -> bool:
        """True where no pair touches."""
        return bool((self.pairs.gaps[self._entered(places)] > 0).all())

    def to_be_known(self, places: np.ndarray, obstacles: ObstacleSet) -> np.ndarray:
        """Numbers of the patches that stay known in the next step: they bear forces, or are near something."""
        far, known = NEAR * self.surroundings.spacing, self.robots.known
        near = np.isin(known, self.pairs.some(self.pairs.gaps < far).used)
        near |= self.robots.on_known.any(axis=1) | (obstacles.nearest(places[known])[0] < far)
        return known[near]

    def memory_after(self, places: np.ndarray, modes: dict[int, Mode]) -> Memory:
        """Memory from where slip counts in the next step; modes by slot."""
        return self.memory.slid(self._slid).after(self.pairs, places, modes)

    def _entered(self, places: np.ndarray) -> np.ndarray:
        return self.surroundings.entered(self.pairs, places, self._begin, self.memory)


def _by_slot(slots: np.ndarray, push: np.ndarray) -> dict[int, np.ndarray]:
    return dict(zip(slots.tolist(), push, strict=True))
