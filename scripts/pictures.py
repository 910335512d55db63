"""Draws the docs' pictures of robots from their pages (`make pages`) in a headless Chromium, with Playwright.

Usage: pictures.py [NAME ...]
    a robot's name        docs/pictures/robots/NAME.webp, in motion, and NAME-still.webp
    page, page-motion     the pictures of docs/page.md
    nothing               all whose pages are there"""

import io
import shutil
import sys
from pathlib import Path

from docs_gallery import PICTURES, robot_pages
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGS = ("--no-sandbox", "--disable-3d-apis")
FRAMES, MILLISECONDS = 36, 70
SEEN, SIZE, BAR = (880, 660), (320, 240), 40  # pixels: of the page, of a frame; what is cut off above and below it
IN_TURN = {"trunk": 4, "stiff-flop": 3, "stiff-flop-serial": 3}  # actuators of one section, where there are several
BARE = """() => { const { state } = cfem;
  document.getElementById("reach").click();
  state.byHand = true; state.moving = false;
  for (const id of ["panel", "tools", "hint"]) document.getElementById(id).hidden = true;
  document.querySelector(".overlay").style.display = "none";
  document.getElementById("page").style.gridTemplateColumns = "1fr"; }"""
TURN_VIEW = "() => document.getElementById('camera').click()"
# The actuators one after the other, each up and down once a lap; two overlap, one alone goes out and back.
POSE = """([phase, inTurn]) => { const { robot } = cfem, force = robot.said.command === "force";
  const most = robot.said.actuators.map(one => force ? one.lambda[1] ?? one.scale : one.delta[1]);
  const count = inTurn ?? most.length;
  const wave = i => Math.cos(2 * Math.PI * (phase - (count > 2 ? i / count : i / 4)));
  robot.set(most.map((one, i) => one * (count > 2 ? 0.75 * Math.max(0, wave(i)) ** 2 : 0.4 - 0.4 * wave(i))), force);
  for (const one of cfem.goals) robot.goal.set(one.tip, one.rows[0]);
  robot.shape(); for (const one of cfem.chambers) one.inflate(); cfem.draw(true); }"""
# docs/page.md: a goal beside the reach under a weight, and a figure-eight at speed.
WEIGHED = """() => { const slide = (id, value) => { const one = document.getElementById(id);
    one.value = value; one.dispatchEvent(new Event("input")); one.dispatchEvent(new Event("change")); };
  slide("weight", 0.56); cfem.moveGoal(cfem.goals[0], [-12.29, 55.65, -96.81]); }"""
RUN = """() => { const speed = document.getElementById("speed");
  speed.value = 0.5 * speed.max; speed.dispatchEvent(new Event("input")); }"""

STOP = "() => { window.requestAnimationFrame = () => 0; }"


def main(names: list[str]) -> int:
    pages = robot_pages()
    missing = [name for name in names if name not in pages and name not in SHOTS]
    if missing:
        print(f"there is no page of {', '.join(missing)}: `make pages` first", file=sys.stderr)
        return 2
    with sync_playwright() as tool:
        program = next(filter(None, map(shutil.which, BROWSERS)), None)
        chromium = tool.chromium.launch(executable_path=program, args=ARGS)
        for name in names or [*pages, *SHOTS]:
            if name in SHOTS:
                SHOTS[name](chromium, pages)
            else:
                in_motion(chromium, name, pages[name])
        chromium.close()
    return 0


def in_motion(chromium: Browser, name: str, path: Path) -> None:
    """Writes one lap of the robot as an animated WebP, and its frame of largest motion as a still one."""
    tab = opened(chromium, path, SEEN[0], SEEN[1] + 2 * BAR)
    tab.evaluate(BARE)
    tab.wait_for_timeout(1500)  # the reach is drawn, which the view frames
    tab.evaluate(TURN_VIEW)
    tab.wait_for_timeout(300)
    frames = []
    for k in range(2 * FRAMES):  # the first lap leads from rest into the loop
        tab.evaluate(POSE, [k / FRAMES, IN_TURN.get(name)])
        if k >= FRAMES:
            clip = {"x": 0, "y": BAR, "width": SEEN[0], "height": SEEN[1]}
            frames.append(picture(tab.screenshot(clip=clip)).resize(SIZE, Image.LANCZOS))
    tab.context.close()
    PICTURES.mkdir(parents=True, exist_ok=True)
    frames[0].save(
        PICTURES / f"{name}.webp", save_all=True, append_images=frames[1:], duration=MILLISECONDS, loop=0, quality=60,
        method=6,
    )  # fmt: skip
    frames[FRAMES // 2].save(PICTURES / f"{name}-still.webp", quality=75, method=6)


def of_the_page(chromium: Browser, pages: dict[str, Path]) -> None:
    tab = opened(chromium, pages["soft-finger"], 1000, 680)
    tab.evaluate(WEIGHED)
    tab.wait_for_timeout(4000)
    tab.screenshot(path=PICTURES.parent / "page.png")
    tab.context.close()


def of_the_page_in_motion(chromium: Browser, pages: dict[str, Path]) -> None:
    tab = opened(chromium, pages["moving-finger"], 1000, 720)
    tab.wait_for_timeout(1500)
    tab.evaluate(RUN)
    tab.wait_for_timeout(6000)
    tab.evaluate(STOP)
    tab.wait_for_timeout(500)
    tab.evaluate("() => cfem.draw(true)")  # with all pixels, as at rest
    tab.screenshot(path=PICTURES.parent / "page-motion.png")
    tab.context.close()


SHOTS = {"page": of_the_page, "page-motion": of_the_page_in_motion}


def opened(chromium: Browser, path: Path, width: int, height: int) -> Page:
    tab = chromium.new_context(viewport={"width": width, "height": height}, color_scheme="light").new_page()
    tab.goto(path.resolve().as_uri())
    tab.wait_for_selector("html[data-state=ready]")
    return tab


def picture(data: bytes) -> Image.Image:
    return Image.open(io.BytesIO(data)).convert("RGB")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
