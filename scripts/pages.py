"""The gallery of pages that `make pages` exports: build/pages/index.html with a picture of each robot, where a Chromium
and Playwright are installed, and the pages beside it.

Usage: pages.py FOLDER...   each a folder of `cfem export` with format html"""

import base64
import json
import shutil
import sys
from html import escape
from pathlib import Path

OUT = Path("build/pages")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
ARGS = ("--no-sandbox", "--disable-3d-apis")
POSE = """() => { const { robot, state, goals, moveGoal, step } = cfem, actuators = robot.said.actuators;
  const shares = actuators.map((one, i) => 0.75 * Math.max(0, Math.cos(2 * Math.PI * i / actuators.length)) ** 2);
  robot.set(actuators.map(({ delta }, i) => delta[0] + shares[i] * (delta[1] - delta[0])), false, true);
  for (const one of goals) robot.goal.set(one.tip, one.rows[0]);
  state.shown = true; document.getElementById("panel").hidden = document.getElementById("tools").hidden = true;
  document.getElementById("hint").hidden = true; document.querySelector(".overlay").style.display = "none";
  document.getElementById("page").style.gridTemplateColumns = "1fr"; }"""
STYLE = """
:root { color-scheme: light dark; --ground: #f6f7f9; --card: #fff; --ink: #1c2430; --soft: #5b6675; --line: #d9dee5; }
@media (prefers-color-scheme: dark) { :root { --ground: #12161c; --card: #1b2129; --ink: #e8edf3; --soft: #a3afbd; --line: #313a46; } }
body { margin: 0 auto; max-width: 1100px; padding: 24px 20px 40px; background: var(--ground); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 26px; margin: 0 0 4px; } p { margin: 0 0 20px; color: var(--soft); }
ul { list-style: none; padding: 0; margin: 0; display: grid; gap: 18px; grid-template-columns: repeat(auto-fill, minmax(240px, 1fr)); }
a { display: block; height: 100%; color: inherit; text-decoration: none; background: var(--card); border: 1px solid var(--line); border-radius: 12px; overflow: hidden; }
a:hover { border-color: var(--soft); } a:focus-visible { outline: 3px solid #1f6fd1; }
img { display: block; width: 100%; aspect-ratio: 4 / 3; object-fit: cover; }
b, span { display: block; padding: 0 14px; } b { padding-top: 10px; } span { padding-bottom: 12px; color: var(--soft); font-size: 14px; }
@media (prefers-color-scheme: dark) { .light { display: none; } } @media (prefers-color-scheme: light) { .dark { display: none; } }
"""  # noqa: E501


def main() -> int:
    folders = [Path(one) for one in sys.argv[1:]]
    OUT.mkdir(parents=True, exist_ok=True)
    cards = []
    names = [name(folder) for folder in folders]
    for folder, own in zip(folders, names, strict=True):
        shutil.copyfile(folder / "page.html", OUT / f"{own}.html")
    for folder, own, pictures in zip(folders, names, photographs([OUT / f"{own}.html" for own in names]), strict=True):
        card = json.loads((folder / "model.json").read_text())
        size = (folder / "page.html").stat().st_size
        count = len(card["rows"]["actuators"])
        words = f"{count} actuator{'s' if count > 1 else ''}, {size / 1e6:.1f}\u00a0MB"
        shown = "".join(
            f'<img class="{theme}" src="data:image/png;base64,{base64.b64encode(data).decode()}" alt="">'
            for theme, data in pictures.items()
        )
        cards.append(f'<li><a href="{own}.html">{shown}<b>{escape(own)}</b><span>{escape(words)}</span></a></li>')
    (OUT / "index.html").write_text(
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Robots</title><style>{STYLE}</style></head><body><h1>Robots</h1>"
        "<p>Each opens a page in which you drag the goal and the robot follows. The pages need no network.</p>"
        f"<ul>{''.join(cards)}</ul></body></html>\n",
        encoding="utf-8",
    )
    print(f"{OUT / 'index.html'}: {len(cards)} robots")
    return 0


def name(folder: Path) -> str:
    """Of the robot, with the model's kind where it is not the usual one."""
    card = json.loads((folder / "model.json").read_text())
    return card["scene"] if card["kind"] == "spectral" else f"{card['scene']}-{card['kind']}"


def photographs(pages: list[Path]) -> list[dict[str, bytes]]:
    """PNG by theme of each page, the robot a little bent; none without a browser."""
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        program = None
    if program is None:
        print("no pictures: they need Playwright and a Chromium", file=sys.stderr)
        return [{} for _ in pages]
    with sync_playwright() as tool:
        chromium = tool.chromium.launch(executable_path=program, args=ARGS)
        found = [{theme: photograph(chromium, page, theme) for theme in ("light", "dark")} for page in pages]
        chromium.close()
    return found


def photograph(chromium, page: Path, theme: str) -> bytes:
    tab = chromium.new_context(viewport={"width": 800, "height": 600}, color_scheme=theme).new_page()
    tab.goto(page.resolve().as_uri())
    tab.wait_for_timeout(1500)
    tab.evaluate(POSE)
    tab.wait_for_timeout(300)
    tab.evaluate("() => { document.getElementById('camera').click(); }")
    tab.wait_for_timeout(700)
    data = tab.screenshot()
    tab.context.close()
    return data


if __name__ == "__main__":
    sys.exit(main())
