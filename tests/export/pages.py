"""Pages of synthetic robots, with a skin made by hand, and the browser that opens them."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from export.embedded import serial, spectral

from cfem.export.embedding import Embedding
from cfem.export.page import page
from cfem.export.spec import CSpec
from cfem.predict.chebyshev import Basis
from cfem.predict.energy import layout

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")  # software: no card is needed
ROBOTS = {
    "one cable": lambda: spectral("displacement", 1),
    "two cables": spectral,
    "three cables": lambda: spectral("displacement", 3),
    "forces": lambda: spectral("force"),
    "modules": serial,
}
UNILATERAL = ("two cables", "forces")


def tube(length: float) -> SimpleNamespace:
    """The skin of a round bar of that length along -z, ten points around, with three modes: it bends both ways and
    lengthens."""
    angle, z = np.meshgrid(np.arange(10) * 2 * np.pi / 10, np.linspace(0, -length, 21))
    rest = np.stack([8 * np.cos(angle), 8 * np.sin(angle), z], axis=-1).reshape(-1, 3)
    i, j = (one.ravel() for one in np.meshgrid(np.arange(20), np.arange(10), indexing="ij"))
    a, b, c, d = 10 * i + j, 10 * i + (j + 1) % 10, 10 * (i + 1) + j, 10 * (i + 1) + (j + 1) % 10
    triangles = np.concatenate([np.column_stack([a, c, b]), np.column_stack([b, c, d])])
    share = (rest[:, 2] / length) ** 2
    modes = np.stack([share[:, None] * np.eye(3)[axis] for axis in range(3)])
    return SimpleNamespace(rest=rest, triangles=triangles, modes=modes)


def skin_series(meta: dict, arrays: dict) -> np.ndarray:
    """(3, M): the skin's rows move as the effector does."""
    one = meta.get("module", meta)
    n_a, n_e = (len(one["rows"][name]) for name in ("actuators", "effectors"))
    return arrays["series"][layout(n_a, n_e)["effector"]][:3]


def skin_rows(arrays: dict, series: np.ndarray, s: np.ndarray) -> np.ndarray:
    """(k,) mm of the skin, by the polynomials as the model has them."""
    return series @ Basis(arrays["indices"])(arrays["to_box"] @ s[: len(arrays["to_box"])] + arrays["offset"])


def page_of(name: str) -> str:
    """Cables pull only where their states do."""
    meta, arrays = ROBOTS[name]()
    spec = CSpec(controller={"unilateral": name in UNILATERAL, "damping": 1e-7 if name == "modules" else 0.0})
    return page(meta, arrays, spec, tube(meta["length"]), skin_series(meta, arrays), Embedding())


@contextmanager
def browser() -> Iterator:
    """Debian's Chromium under Playwright. Where there is none, the tests are skipped and say so."""
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip("NO PAGE WAS TESTED IN A BROWSER: there is no Chromium on the PATH (apt-get install chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        chromium = tool.chromium.launch(executable_path=program, args=[*GL, "--no-sandbox"])
        yield chromium
        chromium.close()


def opened(chromium, path: Path, script: str = "", waits: bool = True, **context):
    """The page; script: runs before all of its own; waits until it is drawn, or says why it is not."""
    there = chromium.new_context(**context)
    if script:
        there.add_init_script(script)
    tab = there.new_page()
    tab.faults = []
    tab.on("pageerror", lambda error: tab.faults.append(str(error)))
    tab.goto(path.as_uri())
    if waits:
        until(tab, "document.documentElement.dataset.state")
    return tab


def until(tab, holds: str, seconds: float = 30) -> None:
    """Waits for what a JavaScript expression says. (The page's policy forbids Playwright's own way.)"""
    for _ in range(int(seconds * 50)):
        if tab.evaluate(f"() => Boolean({holds})"):
            return
        tab.wait_for_timeout(20)
    raise AssertionError(f"never so: {holds}")
