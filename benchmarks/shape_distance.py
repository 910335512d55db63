"""Distance of the learned shape to five kinds of obstacle, against the same of the finite-element surface; Markdown.

Usage: shape_distance.py [ROBOT ...] [--states 50], robots soft-finger and stiff-flop unless given; after

    cfem sample pipelines/ROBOT/sample.yaml --set splits.test.rows=50 && cfem train pipelines/ROBOT/train.yaml

Every test state of the dataset is solved again by finite elements. Five obstacles stand at random places beside its
surface, between 2 mm inside and 10 mm away. `off` is the largest difference of the two distances, learned and finite
elements, beside the error of the skin in the same state: the largest distance of a surface node from its place."""

import argparse
import os
import time
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np
from scipy.spatial.transform import Rotation

import cfem
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Obstacle, Plane, Sphere
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.predict.contact.clearance import clearance

ROOT = Path(__file__).parents[1]
TOLERANCE = 1e-4  # mm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", nargs="*", default=["soft-finger", "stiff-flop"])
    parser.add_argument("--states", type=int, default=50)
    given = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {len(os.sched_getaffinity(0))} cores; CPU times of one core\n")
    columns = "off, largest (mm) | off / skin's own error, largest | skin's own error (mm) | one distance (ms)"
    print(f"| robot | obstacle | states | {columns} |\n|---|---|---|---|---|---|---|")
    for name in given.robots:
        robot(name, given.states)


def robot(name: str, states: int) -> None:
    folder, data = ROOT / "pipelines" / name, ROOT / "data" / name
    model = cfem.load_model(ROOT / "models" / name / "spectral")
    fe = cfem.load_robot(folder / "scene.yaml", data / "mesh")
    test, rng = cfem.read_dataset(data / "samples", "test"), np.random.default_rng(0)
    solid = star(0.1 * model.length)
    off, share, spent, own = {}, {}, {}, []
    for delta_a in test.delta_a[:states]:
        solved = cfem.solve(fe, displacement=delta_a)
        if not solved.converged:
            print(f"a state of {name} did not converge: {solved.status.value}")
            continue
        true, found = solved.state.x[model.skin.nodes], model.shape(delta_a)
        own.append(np.linalg.norm(found - true, axis=1).max())
        for kind, obstacle in obstacles(true, model.facets, model.length, solid, rng).items():
            expected = nearest_of_surface(true, model.facets, obstacle, TOLERANCE).distance
            begin = time.process_time()
            apart = abs(clearance(model, delta_a, obstacle, tolerance=TOLERANCE).distance - expected)
            spent.setdefault(kind, []).append(time.process_time() - begin)
            off.setdefault(kind, []).append(apart)
            share.setdefault(kind, []).append(apart / own[-1])
    for kind in off:
        print(f"| {name} | {kind} | {len(own)} | {max(off[kind]):.2g} | {max(share[kind]):.2f} | {max(own):.2g} | "
              f"{1e3 * np.median(spent[kind]):.1f} |")  # fmt: skip


def obstacles(
    nodes: np.ndarray, triangles: np.ndarray, length: float, solid: ClosedSurface, rng: np.random.Generator
) -> dict[str, Obstacle]:
    """One of each kind, turned at random, beside a random place of a surface."""
    shapes = {
        "plane": lambda pose: Plane(**pose),
        "sphere": lambda pose: Sphere(0.1 * length, **pose),
        "box": lambda pose: Box(length * np.array([0.05, 0.1, 0.15]), **pose),
        "capsule": lambda pose: Capsule(0.05 * length, 0.1 * length, **pose),
        "mesh": lambda pose: ClosedMesh(solid, **pose),
    }
    return {kind: beside(make, nodes, triangles, rng) for kind, make in shapes.items()}


def beside(make, nodes: np.ndarray, triangles: np.ndarray, rng: np.random.Generator) -> Obstacle:
    """Moved along a random direction until the surface is as far as wanted, between 2 mm inside and 10 mm away."""
    wanted, direction = rng.uniform(-2, 10), rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    pose = {"R": Rotation.random(rng=rng).as_matrix(), "t": nodes[rng.integers(len(nodes))]}
    near, far = 0.0, 4 * float(np.ptp(nodes, axis=0).max())
    if isinstance(make(pose), Plane):  # whose outside is to be where the surface is
        turn, _ = Rotation.align_vectors([direction], [[0, 0, 1]])
        pose, direction = {**pose, "R": turn.as_matrix()}, -direction
    for _ in range(24):
        middle = (near + far) / 2
        moved = make({**pose, "t": pose["t"] + middle * direction})
        near, far = (middle, far) if moved.distance(nodes).min() < wanted else (near, middle)
    return make({**pose, "t": pose["t"] + far * direction})


def star(radius: float) -> ClosedSurface:
    """A closed surface with dents and ridges, of 512 triangles."""
    vertices = [*np.eye(3), *-np.eye(3)]
    triangles = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    corners = np.array(vertices)[np.array(triangles)]
    for _ in range(3):
        a, b, c = corners.swapaxes(0, 1)
        ab, bc, ca = (unit(one + other) for one, other in ((a, b), (b, c), (c, a)))
        split = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(one, axis=1) for one in split])
    vertices, numbers = np.unique(np.round(corners.reshape(-1, 3), 12), axis=0, return_inverse=True)
    return ClosedSurface(radius * vertices * (1 + 0.3 * np.sin(5 * vertices[:, :1])), numbers.reshape(-1, 3))


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


if __name__ == "__main__":
    main()
