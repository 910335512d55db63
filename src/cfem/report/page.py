"""The page: one HTML file with everything inside, for screens large and small and for paper."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from typing import Any, Protocol

from cfem import viewer

ASSETS = ("page.css", "player.js", "page.js")
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


class PageElement(Protocol):
    """A chart, a table, a robot."""

    def html(self) -> str: ...


@dataclass(frozen=True)
class ReportSection:
    """A heading, a sentence or two, and what it shows; facts: for results.json."""

    title: str
    text: str
    parts: tuple[PageElement, ...]
    facts: dict[str, Any] = field(default_factory=dict)

    def key(self, place: int) -> str:
        """Key of a section's link."""
        return f"{place + 1}-" + re.sub(r"[^a-z0-9]+", "-", self.title.lower()).strip("-")

    def html(self, place: int, unfolded: bool) -> str:
        parts = "\n".join(part.html() for part in self.parts)
        text = f"<p>{escape(self.text)}</p>" if self.text else ""
        title = escape(self.title)
        return (
            f'<details id="{self.key(place)}"{" open" if unfolded else ""}><summary><h2>{title}</h2></summary>'
            f"{text}\n{parts}</details>"
        )


@dataclass(frozen=True)
class Card:
    """A picture beside what it shows in words; link: HTML below it."""

    picture: PageElement
    facts: Mapping[str, str]
    link: str = ""

    def html(self) -> str:
        facts = "".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in self.facts.items())
        return f'<section class="card"><h2>The robot</h2>{self.picture.html()}<dl>{facts}</dl>{self.link}</section>'


@dataclass(frozen=True)
class Number:
    """One of the numbers that matter, with its unit."""

    value: str
    name: str  # what it is
    notes: tuple[str, ...] = ()  # what to hold beside it, line by line

    def html(self) -> str:
        notes = "".join(f"<small>{escape(note)}</small>" for note in self.notes)
        return f"<li><strong>{escape(self.value)}</strong><span>{escape(self.name)}</span>{notes}</li>"


@dataclass(frozen=True)
class Summary:
    """The first screen: one sentence on the outcome, what is poor about it (worst first), and the numbers."""

    sentence: str
    concerns: tuple[str, ...] = ()
    numbers: tuple[Number, ...] = ()

    def html(self, robot: PageElement | None) -> str:
        lines = [f'<p class="poor">{escape(concern)}</p>' for concern in self.concerns]
        lines.append(f'<p class="lead">{escape(self.sentence)}</p>')
        numbers = "".join(number.html() for number in self.numbers)
        picture = robot.html() if robot else ""
        shown = f'<div class="first">{picture}<ul class="numbers">{numbers}</ul></div>' if picture or numbers else ""
        return "".join(lines) + shown


def assets() -> tuple[str, str]:
    """Style and script of every page with robots that play."""
    style, *scripts = ((files("cfem.report") / name).read_text(encoding="utf-8") for name in ASSETS)
    return style + viewer.asset("viewer.css"), viewer.script(*scripts)


def page(
    title: str, summary: Summary, robot: PageElement | None, card: Card | None, sections: Sequence[ReportSection]
) -> str:
    """The whole file. robot: its animation. Without it, the first section is unfolded."""
    links = "".join(
        f'<li><a href="#{section.key(place)}">{escape(section.title)}</a></li>'
        for place, section in enumerate(sections)
    )
    body = "\n".join(section.html(place, robot is None and place == 0) for place, section in enumerate(sections))
    return document(
        title,
        f"<h1>{escape(title)}</h1>\n{summary.html(robot)}\n{card.html() if card else ''}\n"
        f'<nav aria-label="contents"><ul>{links}</ul></nav>\n{body}\n',
    )


def document(title: str, main: str, style: str = "", data: str = "", script: str = "") -> str:
    """HTML file with the style and script of `assets`; style, script: further ones; data: JSON for the script."""
    own_style, own_script = assets()
    further = f'<script type="application/json" id="data">{data}</script>' if data else ""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f"<title>{escape(title)}</title><style>{own_style}{style}</style></head>\n"
        f"<body><main>{main}</main>{further}<script>{own_script}</script>"
        f"{f'<script>{script}</script>' if script else ''}</body></html>\n"
    )
