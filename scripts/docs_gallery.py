"""The gallery of the site: every robot of the catalogue, with its picture, its page and where the docs use it."""

import re
from html import escape
from pathlib import Path

import yaml

PICTURES = Path("docs/pictures/robots")
PIPELINES = Path("pipelines")
SITE = Path("docs")
COMMENT = re.compile(r"^# (?!yaml-language-server)(.*)$")


def robot_pages() -> dict[str, Path]:
    """The pages that `make pages` has exported, by the name of the robot, with the model's where it has several."""
    made = sorted(Path("models").glob("*/page*/page.html"))
    return {path.parents[1].name + path.parent.name.removeprefix("page"): path for path in made}


def catalogue() -> list[str]:
    """Names of the robots in pipelines/, those that have a page first."""
    names = {path.parent.name for kind in ("scene", "train") for path in PIPELINES.glob(f"*/{kind}.yaml")}
    return sorted(names, key=lambda name: (not page_specs(name), name))


def page_specs(name: str) -> list[Path]:
    return sorted((PIPELINES / name).glob("export-page*.yaml"), key=lambda path: path.stem)


def description(name: str) -> str:
    """The comment that begins the robot's first spec."""
    text = next(path for kind in ("scene", "sample") if (path := PIPELINES / name / f"{kind}.yaml").exists())
    lines = []
    for line in text.read_text().splitlines():
        if found := COMMENT.match(line):
            lines.append(found[1])
        elif lines or not line.startswith("#"):
            break
    return " ".join(lines)


def where_used(name: str) -> list[tuple[str, str]]:
    """Path and title of the pages that name the robot's folder or target, the most frequent first."""
    mention = re.compile(rf"(?:pipelines/|make ){re.escape(name)}(?![\w-])")
    counts = {}
    for path in sorted(SITE.glob("*.md")):
        if path.stem not in ("gallery", "index") and (count := len(mention.findall(path.read_text()))):
            counts[path] = count
    best = sorted(counts, key=lambda path: -counts[path])[:3]
    return [(path.name, re.search(r"^# (.*)", path.read_text(), re.MULTILINE)[1]) for path in best]


def gallery() -> str:
    """Markdown: a card per robot with a page, a table of the others."""
    pages, names = robot_pages(), catalogue()
    shown = [name for name in names if page_specs(name)]
    lines = ['<div class="robots" markdown>', ""]
    for name in shown:
        lines += [*_card(name, pages), ""]
    lines += ["</div>", "", "## Without a page of their own", "", "| robot | what it is | read |", "|---|---|---|"]
    for name in names:
        if name not in shown:
            lines.append(f"| <span id='{name}'></span>`{name}` | {description(name)} | {_links(name)} |")
    return "\n".join(lines) + "\n"


def front_row(names: list[str]) -> str:
    """HTML: pictures of the robots in motion, each a link to its card in the gallery."""
    links = (f'<a href="gallery.html#{name}">{moving_picture(name)}</a>' for name in names)
    return f'<div class="robots">{"".join(links)}</div>'


def _card(name: str, pages: dict[str, Path]) -> list[str]:
    live = [key for spec in page_specs(name) if (key := _key(name, spec)) in pages]
    picture = moving_picture(name)
    first = f"[{picture}](robots/{live[0]}.html)" if live and picture else picture
    title = " · ".join(f"[{key}](robots/{key}.html)" for key in live) or name
    read = _links(name)
    return [
        f'<div id="{name}" class="robot" markdown>',
        first,
        f"**{title}**",
        "",
        description(name) + (f" Read: {read}." if read else "") + ("" if live else " `make pages` makes its page."),
        "",
        "</div>",
    ]


def moving_picture(name: str) -> str:
    """HTML of the robot in motion, still for a reader who wants no motion; empty without a picture."""
    if not (PICTURES / f"{name}.webp").exists():
        return ""
    folder = PICTURES.relative_to(SITE)
    return (
        f'<picture><source media="(prefers-reduced-motion: reduce)" srcset="{folder}/{name}-still.webp">'
        f'<img src="{folder}/{name}.webp" width="320" height="240" alt="{escape(name)} in motion"></picture>'
    )


def _key(name: str, spec: Path) -> str:
    return name + Path(yaml.safe_load(spec.read_text())["out"]).name.removeprefix("page")


def _links(name: str) -> str:
    return ", ".join(f"[{title}]({path})" for path, title in where_used(name))
