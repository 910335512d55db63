"""Pages of synthetic robots, with a skin made by hand, and the browser that opens them."""

import base64
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from export.embedded import serial, spectral

from cfem.export.firmware.embedding import Embedding
from cfem.export.page.page import page
from cfem.export.spec import CSpec
from cfem.predict.rows.serial import module_arrays
from cfem.predict.series.chebyshev import Basis, basis
from cfem.predict.series.energy import layout
from cfem.surrogate.series.spectral import Series, series

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BARE = ("--no-sandbox", "--disable-3d-apis")  # no graphics card is needed
ROBOTS = {
    "one cable": lambda: spectral("displacement", 1),
    "two cables": spectral,
    "three cables": lambda: spectral("displacement", 3),
    "forces": lambda: spectral("force"),
    "modules": serial,
}
UNILATERAL = ("two cables", "forces")


# The data of an image (width, height) as text: millions of numbers take a minute through JSON.
PACKED = """data => { let text = ""; const chunk = 32768;
  for (let i = 0; i < data.length; i += chunk) text += String.fromCharCode.apply(null, data.subarray(i, i + chunk));
  return btoa(text); }"""


def unpacked(text: str) -> np.ndarray:
    """Pixels (n, 4) as integers, from `PACKED`."""
    return np.frombuffer(base64.b64decode(text), np.uint8).reshape(-1, 4).astype(int)


def tube(length: float) -> dict[str, np.ndarray]:
    """The surface of a round bar of that length along -z, ten points around, with three modes: it bends both ways and
    lengthens."""
    angle, z = np.meshgrid(np.arange(10) * 2 * np.pi / 10, np.linspace(0, -length, 21))
    rest = np.stack([8 * np.cos(angle), 8 * np.sin(angle), z], axis=-1).reshape(-1, 3)
    i, j = (one.ravel() for one in np.meshgrid(np.arange(20), np.arange(10), indexing="ij"))
    a, b, c, d = 10 * i + j, 10 * i + (j + 1) % 10, 10 * (i + 1) + j, 10 * (i + 1) + (j + 1) % 10
    triangles = np.concatenate([np.column_stack([a, c, b]), np.column_stack([b, c, d])])
    share = (rest[:, 2] / length) ** 2
    modes = np.stack([share[:, None] * np.eye(3)[axis] for axis in range(3)])
    return {"rest": rest, "triangles": triangles, "modes": modes.astype(np.float32)}


def wedge() -> tuple[dict, dict]:
    """Two cables, (m + q) / 2 and (m - q) / 2, of the potential m^2 / 2 + q^2 - q^4 / 150, which is convex where
    |q| < 5. Where the second cable is slack, m = 2 q - 2 q^3 / 75: at q = 4 the first is 5.147 mm."""
    indices = np.array([(i, j) for i in range(5) for j in range(5)])
    to_box, offset = np.eye(2) / 8, np.zeros(2)
    at = np.random.default_rng(1).uniform(-8, 8, (100, 2))
    m, q = at[:, 0] + at[:, 1], at[:, 0] - at[:, 1]
    values = np.column_stack([m**2 / 2 + q**2 - q**4 / 150, m, q, 0 * q])
    found = np.linalg.lstsq(basis(at @ to_box, indices), values, rcond=None)[0]
    parts = {"potential": found[:, :1], "effector": found[:, 1:], "effector_compliance": np.zeros((len(indices), 6))}
    made = series({name: Series(indices, part) for name, part in parts.items()}, to_box, 2)
    meta, _ = spectral()
    return meta, {"to_box": to_box, "offset": offset, "indices": made["indices"], "series": made["series"]}


def skin_of(meta: dict, arrays: dict) -> dict[str, np.ndarray]:
    """A tube, whose modes move as the effector does, of the model's first actuators."""
    one = meta.get("modules", [meta])[0]
    arrays = module_arrays(arrays, 0) or arrays
    n_a, n_e = (len(one["rows"][name]) for name in ("actuators", "effectors"))
    others = len(meta["rows"]["actuators"]) - n_a  # of modules behind the first, which the skin does not feel
    n = arrays["to_box"].shape[1]
    return tube(meta["length"]) | {
        "to_box": np.pad(arrays["to_box"], ((0, others), (0, others))) + np.diag([0.0] * n + [0.1] * others),
        "offset": np.pad(arrays["offset"], (0, others)),
        "indices": np.pad(arrays["indices"], ((0, 0), (0, others))),
        "series": arrays["series"][layout(n_a, n_e)["effector"]][:3],
    }


def surface(skin: dict[str, np.ndarray], s: np.ndarray) -> np.ndarray:
    """(n, 3) mm at inputs s of the form, by the polynomials as they are stored."""
    rows = skin["series"] @ Basis(skin["indices"])(skin["to_box"] @ s + skin["offset"])
    return skin["rest"] + np.tensordot(rows, skin["modes"].astype(float), axes=1)


def page_of(name: str) -> str:
    """Cables pull only where their states do."""
    meta, arrays = ROBOTS[name]()
    spec = CSpec(controller={"unilateral": name in UNILATERAL, "damping": 1e-7 if name == "modules" else 0.0})
    return page(meta, arrays, skin_of(meta, arrays), spec, Embedding())


@contextmanager
def browser() -> Iterator:
    """Debian's Chromium under Playwright. Where there is none, the tests are skipped and say so."""
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip("NO PAGE WAS TESTED IN A BROWSER: there is no Chromium on the PATH (apt-get install chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        chromium = tool.chromium.launch(executable_path=program, args=BARE)
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
