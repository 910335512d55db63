"""The page of a robot (`cfem export`, format html): its size, what a picture costs in a headless Chromium that draws in
software, and a tick of its WebAssembly, of the same C code by gcc -O2 and of the firmware's by gcc -O2. Prints one JSON
object.

Usage: page.py FOLDER   of an export with both formats: cfem export SPEC --set "formats=[html, c]" --out FOLDER; of one
with the page alone, without the comparison of ticks"""

import contextlib
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGS = ("--no-sandbox", "--disable-3d-apis")
ROUNDS = 15
PICTURED = 150
EXPORT = Path(__file__).parents[1] / "src/cfem/export"
SOURCES = (
    "controller",
    "feedback",
    "condense",
    "serial",
    "spectral",
    "qp",
    "active",
    "inverse",
)  # as in scripts/wasm.py
# The path of measure.c: from home to each goal and on to the next in 20 ticks; ns a tick, the shortest of some times.
TICKS = """commands => {
  const { robot } = cfem, goals = commands.map(c => { robot.set(c, cfem.robot.said.command === "force", false); return [...robot.x_e]; });
  const follow = () => {
    robot.home();
    let from = [...robot.x_e], ticks = 0;
    for (const goal of goals) {
      for (let k = 1; k <= 20; k++, ticks++) { for (let e = 0; e < from.length; e++) robot.goal[e] = from[e] + k / 20 * (goal[e] - from[e]); robot.tick(); }
      from = goal;
    }
    return ticks;
  };
  const times = [];
  for (let i = 0; i < 40; i++) {
    const begin = performance.now();
    let ticks = 0;
    while (performance.now() < begin + 15) ticks += follow();
    times.push(1e6 * (performance.now() - begin) / ticks);
  }
  return Math.min(...times);
}"""  # noqa: E501
# ms of one picture, all included: a tick, the surface, and drawing until its pixels are there.
PICTURES = """() => {
  const { robot, step, moveGoal, goals, draw } = cfem;
  const brush = document.getElementById("view").getContext("2d"), found = [];
  const start = goals[0].tip, size = 0.1 * robot.said.length;
  for (let i = 0; i < 150; i++) {
    const begin = performance.now();
    moveGoal(goals[0], [9, 7, 11].map((period, axis) => start[axis] + size * Math.sin(i / period)));
    step(1);
    const ticked = performance.now();
    robot.shape();
    const shaped = performance.now();
    draw();
    brush.getImageData(0, 0, 1, 1);
    found.push([ticked - begin, shaped - ticked, performance.now() - shaped]);
  }
  return found.slice(20);
}"""


def main() -> int:
    from playwright.sync_api import sync_playwright

    page, firmware = Path(sys.argv[1]) / "page.html", Path(sys.argv[1]) / "c"
    compared = firmware.is_dir()
    if compared:
        subprocess.run(["make", "-s", "-C", firmware, "measured"], check=True)
    program = next(filter(None, map(shutil.which, BROWSERS)))
    ticks = []
    with sync_playwright() as tool:
        chromium = tool.chromium.launch(executable_path=program, args=ARGS)
        tab = chromium.new_context(viewport={"width": 1280, "height": 800}).new_page()
        tab.goto(page.resolve().as_uri())
        tab.wait_for_selector("html[data-state=ready]", state="attached")
        tab.wait_for_timeout(3000)  # the reach is complete
        tab.evaluate(PICTURES)
        before = processor_time()
        pictures = np.array(tab.evaluate(PICTURES))
        spent = processor_time() - before
        for _ in range(ROUNDS if compared else 0):  # by turns: the machine's clock is not the same all the time
            printed = subprocess.run([firmware / "measured"], capture_output=True, text=True, check=True).stdout
            here = float(re.search(r"tick median (\d+)", printed)[1])
            asked = commands(printed, tab)
            ticks.append([tab.evaluate(TICKS, asked), here, native(page, asked, tab)])
        chromium.close()
    shares = {"shortest_tenth": 0.1, "median": 0.5, "p99": 0.99}  # other processes make the long ones
    parts = zip(("tick", "surface", "drawing"), pictures.T, strict=True)
    result = {
        "page_bytes": page.stat().st_size,
        "picture_ms": {name: float(np.quantile(pictures.sum(axis=1), share)) for name, share in shares.items()},
        "parts_ms": {name: float(np.quantile(values, 0.1)) for name, values in parts},
        "processor_ms": 1e3 * spent / PICTURED,
    }
    if compared:
        web, c, own = np.min(ticks, axis=0)
        result["tick_ns"] = {"webassembly": web, "firmware_gcc": c, "page_gcc": own}
        result["ratio"] = {"webassembly": web / c, "page_gcc": own / c}
    print(json.dumps(result, indent=1))
    return 0


def processor_time() -> float:
    """Seconds of all processes that this one started."""
    found = 0.0
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            found += sum(child.cpu_times()[:2])
    return found


def native(page: Path, asked: list[list[float]], tab) -> float:
    """ns a tick of the page's C code by gcc -O2."""
    folder = page.parent / "native"
    if not (folder / "page").exists():
        folder.mkdir(exist_ok=True)
        web, firmware = EXPORT / "page/web", EXPORT / "firmware/sources/controller"
        sources = [web / "cfem_page.c", *(firmware / f"cfem_{name}.c" for name in SOURCES)]
        options = ["-O2", "-std=c11", "-D_GNU_SOURCE", "-w", "-I", web, "-I", firmware]
        program = [*options, "-o", folder / "page", Path(__file__).with_name("page_native.c"), *sources, "-lm"]
        subprocess.run(["gcc", *program], check=True)
    (folder / "block").write_bytes(bytes(tab.evaluate("() => [...cfem.robot.block]")))
    (folder / "commands").write_bytes(np.array(asked).tobytes())
    by_force = str(int(tab.evaluate("() => cfem.robot.said.command === 'force'")))
    done = subprocess.run(
        [folder / "page", folder / "block", folder / "commands", by_force], capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def commands(printed: str, tab) -> list[list[float]]:
    """What measure.c commanded at each of its goals."""
    by_force, n = tab.evaluate("() => [cfem.robot.said.command === 'force', cfem.robot.n_a]")
    found = [[float(word) for word in line.split()[2:]] for line in printed.splitlines() if line.startswith("command")]
    return [one[n:] if by_force else one[:n] for one in found]


if __name__ == "__main__":
    sys.exit(main())
