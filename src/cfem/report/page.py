"""The page: one HTML file with everything inside, no scripts, for screens large and small and for paper."""

import base64
from dataclasses import dataclass
from html import escape

STYLE = """
:root { color-scheme: light dark; --ink: #22303c; --soft: #5c6b7a; --line: #d8dee4; --card: #fff; --ground:
#f5f7f9; } @media (prefers-color-scheme: dark) {
  :root { --ink: #e4e9ee; --soft: #9fb0c0; --line: #34414d; --card: #1b242c; --ground: #12181e; }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 16px/1.55 system-ui, "Segoe UI", "Liberation Sans", sans-serif; }
main { max-width: 62rem; margin: 0 auto; padding: 2rem 1rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.2rem; margin: 2.6rem 0 .6rem; }
p { max-width: 46rem; margin: .5rem 0 .9rem; }
.lead, figcaption { color: var(--soft); }
figure { margin: 1rem 0; }
figure img { display: block; width: 100%; height: auto; background: #fff; border: 1px solid var(--line);
border-radius: 8px; } .pair { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fit, minmax(19rem,
1fr)); } figcaption { font-size: .88rem; margin-top: .4rem; }
.scroll { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: .84rem;
background: var(--card); } th, td { padding: .42rem .7rem; border-bottom: 1px solid var(--line); text-align:
right; white-space: nowrap; } th:first-child, td:first-child { text-align: left; }
thead th { white-space: normal; vertical-align: bottom; border-bottom: 2px solid var(--line); font-weight: 600;
} code { font-size: .86em; overflow-wrap: anywhere; }
@media print { body { background: #fff; color: #000; } figure, table { break-inside: avoid; } main { padding:
0; max-width: none; } }"""


@dataclass(frozen=True)
class Picture:
    """png: bytes; caption says what to see, and serves those who cannot see it."""

    png: bytes
    caption: str


@dataclass(frozen=True)
class Table:
    """head and rows of text cells, the first column left-aligned."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


@dataclass(frozen=True)
class Section:
    """A heading, a sentence or two, and what it shows."""

    title: str
    text: str
    parts: tuple[Picture | Table | tuple[Picture, ...], ...]


def page(title: str, lead: str, sections: list[Section]) -> str:
    """The whole file."""
    body = "\n".join(_section(section) for section in sections)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n"
        f'<body><main><h1>{escape(title)}</h1><p class="lead">{escape(lead)}</p>\n{body}\n</main></body></html>\n'
    )


def _section(section: Section) -> str:
    parts = "\n".join(_part(part) for part in section.parts)
    text = f"<p>{escape(section.text)}</p>" if section.text else ""
    return f"<section><h2>{escape(section.title)}</h2>{text}\n{parts}</section>"


def _part(part: Picture | Table | tuple[Picture, ...]) -> str:
    if isinstance(part, tuple):
        return '<div class="pair">' + "".join(_part(one) for one in part) + "</div>"
    if isinstance(part, Picture):
        data = base64.b64encode(part.png).decode()
        caption = escape(part.caption)
        image = f'<img alt="{caption}" src="data:image/png;base64,{data}">'
        return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in part.head)
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in part.rows)
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
