"""Bars of many shapes, sampled and learned, for a design to be chosen from."""

from pathlib import Path

from support.bar_scene import bar_scene

from cfem.core.stage import Options
from cfem.robot.stage import run as make_mesh
from cfem.sample.stage import run as simulate_sample
from cfem.surrogate.stage import run as train

QUIET = Options(quiet=True)
TRAIN = "dataset: samples\nout: model\nmodel: {kind: spectral, max_degree: 6}\n"


def learn(folder: Path, size: float, sample: str, design: str) -> None:
    """Fills the folder: mesh of that size (mm), samples, model, and the specs, design.yaml among them."""
    texts = {"scene": bar_scene(size, "tet4", 0.3), "sample": sample, "train": TRAIN, "design": design}
    for name, text in texts.items():
        (folder / f"{name}.yaml").write_text(text)
    make_mesh(folder / "scene.yaml", [], None, QUIET)
    simulate_sample(folder / "sample.yaml", [], None, QUIET, workers=1)
    train(folder / "train.yaml", [], None, QUIET)
