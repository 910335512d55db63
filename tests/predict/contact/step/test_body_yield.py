"""How pairs yield as rigid bodies move, against finite differences of the bodies' whole motion."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.contact.patch_forces import balance, turned
from cfem.contact.rigid_bodies import RigidBodies, motions
from cfem.predict.contact.step.body_yield import levers
from cfem.predict.contact.step.poses import Poses

RNG = np.random.default_rng(2)
ROBOTS, OBSTACLES = np.array([0, -1]), np.array([1, -1])  # body of each, of two
OF, WHICH = np.array([0, 0, 0, 1, 1]), np.array([1, 0, 0, 0, 1])  # robot and obstacle of each patch
NEAR, KNOWN, SOFT = np.array([1, 3, 4]), np.arange(5), np.array([[0.0, 1.0, 0.0, -0.25, -0.75]])


class Forces:
    """Five patches of two robots, of which one stands still, on obstacles of which one stands still, three of them near
    these, and a soft pair. Patch 3 slides, and patch 4 on a curved surface.

    forces (5, 3) N bear on them, push (5, 3) N of obstacles; places (5, 3) mm; compliance (15, 15) mm/N"""

    def __init__(self, soft):
        factor, root = RNG.normal(size=(12, 12)), RNG.normal(size=(15, 15))
        self.soft = SOFT if soft else np.zeros((0, 5))
        self.known = KNOWN if soft else NEAR
        self.places, self.push, self.local = RNG.normal(size=(5, 3)), np.zeros((5, 3)), RNG.normal(size=(4, 3))
        self.push[NEAR] = self.local[:3]
        self.slides, self.bends = np.array([False, True, True]), np.zeros((5, 3, 3))
        self.bends[4] = 0.3 * RNG.normal(size=(3, 3))
        rows = (3 * self.known[:, None] + np.arange(3)).ravel()
        self.C = 0.02 * (root @ root.T)[np.ix_(rows, rows)]
        self.forces = self.push + (self.soft.T @ self.local[3:] if soft else 0.0)
        self.rigid = RigidBodies(RNG.normal(size=(2, 3)), 0.002 * factor @ factor.T, np.zeros(12), ROBOTS, OBSTACLES)
        self.before = self.wrench(self.places, self.forces, self.push)

    @property
    def relative(self):
        if not len(self.soft):
            return None
        return np.concatenate([np.eye(5)[NEAR], self.soft])

    def wrench(self, places, forces, push):
        wrench = np.zeros((2, 2, 3))
        for body, place, force, pushed, met in zip(ROBOTS[OF], places, forces, push, OBSTACLES[WHICH], strict=True):
            for number, of_body in ((body, force), (met, -pushed)):
                if number >= 0:
                    wrench[number] += of_body, np.cross(place - self.rigid.centres[number], of_body)
        return wrench.ravel()

    def gaps(self, change):
        """(p, 3) mm of pairs, places of patches less where the obstacles have carried these, and (d, 3) N of obstacles,
        where pairs bear `change` (p, 3) N more: by iteration."""
        xi, push, moved, forces = np.zeros(12), self.push.copy(), np.zeros((5, 3)), self.forces
        for _ in range(60):
            R, t = motions(xi, self.rigid.centres)
            places, carried = self.places + moved, self.places.copy()
            for i in range(5):
                if ROBOTS[OF[i]] >= 0:
                    places[i] = R[ROBOTS[OF[i]]] @ places[i] + t[ROBOTS[OF[i]]]
                if OBSTACLES[WHICH[i]] >= 0:
                    carried[i] = R[OBSTACLES[WHICH[i]]] @ carried[i] + t[OBSTACLES[WHICH[i]]]
            for place, patch in enumerate(NEAR):
                push[patch] = self.local[place] + change[place]
                if self.slides[place] and OBSTACLES[WHICH[patch]] >= 0:
                    push[patch] = R[OBSTACLES[WHICH[patch]]] @ push[patch]
                push[patch] += self.bends[patch] @ (places - carried)[patch]
            forces = push + (self.soft.T @ (self.local[3:] + change[3:]) if len(self.soft) else 0.0)
            moved = np.zeros((5, 3))
            moved[self.known] = (self.C @ (forces - self.forces)[self.known].ravel()).reshape(-1, 3)
            xi = self.rigid.mobility @ (self.wrench(places, forces, push) - self.before)
        return np.concatenate([(places - carried)[NEAR], self.soft @ places]), push[NEAR]


@pytest.mark.parametrize("moves", [True, False])
@pytest.mark.parametrize("soft", [True, False])
def test_pairs_yield_and_forces_turn_as_differences_say(soft, moves):
    it = Forces(soft)
    if not moves:
        it.rigid = RigidBodies(it.rigid.centres, 0 * it.rigid.mobility, it.before, ROBOTS, OBSTACLES)
    relative, p = it.relative, len(NEAR) + len(it.soft)
    poses = Poses(
        SimpleNamespace(bodies=OF, obstacles=None, rigid=it.rigid if moves else None),
        SimpleNamespace(known=it.known),
    )
    curved = turned(it.C, it.bends[it.known])
    loads = it.forces[it.known], it.push, it.slides
    found = poses.yields(it.places, NEAR, WHICH, loads, relative, curved.compliance, curved)
    B = np.eye(9) if relative is None else np.kron(relative, np.eye(3))
    total = B @ curved.compliance @ B.T + (found.mobility if moves else 0.0)
    h, by_differences, turns = 1e-6, [], []
    for entry in np.eye(3 * p):
        ahead, behind = (it.gaps(sign * h * entry.reshape(-1, 3)) for sign in (1, -1))
        by_differences.append((ahead[0] - behind[0]).ravel() / (2 * h))
        turns.append((ahead[1] - behind[1]).ravel() / (2 * h) - entry[:9])
    np.testing.assert_allclose(total, np.transpose(by_differences), atol=1e-7 * np.abs(total).max())
    np.testing.assert_allclose(found.turning, np.transpose(turns), atol=1e-7)


def test_without_forces_pairs_yield_as_their_levers_say():
    it = Forces(True)
    nothing = np.zeros((5, 3)), np.zeros((5, 3)), np.zeros(3, dtype=bool)
    given = (it.places, NEAR, NEAR, WHICH, KNOWN, SOFT, *nothing, np.zeros((0, 3, 3)), ROBOTS, OF, OBSTACLES)
    G, L, H, T = levers(*given, it.rigid.centres)
    of_patches = it.rigid.levers(ROBOTS[OF], it.places)
    near = of_patches[NEAR] - it.rigid.levers(OBSTACLES[WHICH[NEAR]], it.places[NEAR])
    np.testing.assert_allclose(L, of_patches.reshape(15, 12))
    np.testing.assert_allclose(G, np.concatenate([near, np.einsum("qc,cij->qij", SOFT, of_patches)]).reshape(12, 12))
    assert not H.any() and not T.any()
    poses = Poses(SimpleNamespace(bodies=OF, obstacles=None, rigid=it.rigid), SimpleNamespace(known=KNOWN))
    found = poses.yields(it.places, NEAR, WHICH, nothing, it.relative, it.C, None)
    np.testing.assert_allclose(found.mobility, G @ it.rigid.mobility @ G.T)
    assert found.turning is None


@pytest.mark.parametrize("slides", [True, False])
def test_the_law_in_one_call_is_that_of_its_parts(slides):
    it, n, frames = Forces(False), len(NEAR), Rotation.random(3, rng=RNG).as_matrix()
    scene = SimpleNamespace(bodies=OF, obstacles=None, rigid=it.rigid, mu=0.6)
    poses = Poses(scene, SimpleNamespace(known=NEAR))
    loads = it.forces[NEAR], it.push, it.slides & slides
    gaps = 0.1 * RNG.normal(size=(n, 3)) - [0.2, 0.0, 0.0]
    answer, yields = poses.balance(frames, gaps, it.places, NEAR, WHICH, loads, it.C)
    parts = poses.yields(it.places, NEAR, WHICH, loads, None, it.C, None)
    np.testing.assert_allclose(yields.mobility, parts.mobility, atol=1e-12)
    assert (yields.turning is not None) == (parts.turning is not None) == slides
    if slides:
        np.testing.assert_allclose(yields.turning, parts.turning, atol=1e-12)
    by_parts = balance(None, frames, it.C, gaps, loads[0], it.push[NEAR], 0.6, parts.mobility)
    assert answer.modes == by_parts.modes and answer.push.any()
    for name in ("local", "push", "forces", "change", "step", "slid"):
        values, expected = getattr(answer, name), getattr(by_parts, name)
        np.testing.assert_allclose(values, expected, atol=1e-10 * max(1.0, np.abs(expected).max()))
