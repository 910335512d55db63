"""Pages of the site that come from the code: the command line, and every spec. A hook of MkDocs (`make docs`)."""

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docs_gallery import front_row, gallery, robot_pages
from mkdocs.structure.files import File

OUTSIDE = r"\[([^\]]*)\]\(\.\./{}([^)]+)\)"  # a link to a file outside docs/, of a page so many folders down

# what stands for a generated page in a checkout, and that page
GENERATED = {
    r"\.\./schemas/(\w+)\.json": r"reference/\1.md",
    r"\.\./src/cfem/cli": "reference/cli.md",
    r"\.\./src/cfem/core/errors\.py": "reference/cli.md#exit-codes",
    r"notebooks/([\w-]+)\.ipynb": r"notebooks/\1.md",
}
PICTURE = re.compile(r'<img src="tracked-finger.gif"[^>]*>')  # of the front page, where no live robot is there
LIVE = (
    '<iframe src="robots/soft-finger.html" title="The soft finger, live: drag its tip" loading="lazy" '
    'style="width: 100%; height: 34rem; border: 1px solid #ccc; border-radius: 8px"></iframe>'
)
IN_MOTION = re.compile(r"<!-- in motion: (.*) -->")  # on the front page: these robots, each a link into the gallery
KIND = re.compile(r"(.*?)(?: \(([^()]*e\.g\. [^()]*)\))?")  # a description, and the quantity that it is
WORDS = {"string": "text", "integer": "whole number", "boolean": "true or false"}


def on_config(config):
    """The repository's address is stated once, in pyproject.toml."""
    project = tomllib.loads(Path(config.config_file_path).with_name("pyproject.toml").read_text())["project"]
    urls = project.get("urls", {})
    config.repo_url = urls.get("Repository") or urls.get("Source")
    return config


def on_files(files, config):
    for path, text in pages().items():
        files.append(File.generated(config, path, content=text))
    for name, path in robot_pages().items():
        files.append(File.generated(config, f"robots/{name}.html", abs_src_path=str(path.resolve())))
    return files


def on_page_markdown(markdown, page, config, files):
    """Links to what a page is generated from lead to that page. Those to other files of the repository outside docs/
    lead to its web page; without one, only their path is shown."""
    if page.file.src_uri == "index.md" and "soft-finger" in robot_pages():
        markdown = PICTURE.sub(LIVE, markdown, count=1)
    markdown = IN_MOTION.sub(lambda found: front_row(found[1].split(", ")), markdown)
    if page.file.src_uri == "gallery.md":
        markdown += gallery()
    for there, page_of_site in GENERATED.items():
        markdown = re.sub(rf"\]\({there}\)", f"]({page_of_site})", markdown)
    outside = re.compile(OUTSIDE.format(r"\.\./" * page.file.src_uri.count("/")))
    return outside.sub(rf"[\1]({config.repo_url}/blob/main/\2)" if config.repo_url else r"\1 (`\2`)", markdown)


def pages() -> dict[str, str]:
    """Path under docs/ -> Markdown."""
    from cfem.core.kinds import KINDS, model_of
    from cfem.core.spec import json_schema

    made = {f"reference/{name}.md": spec_page(name, json_schema(model_of(name))) for name in KINDS}
    made |= {f"notebooks/{path.stem}.md": notebook_page(path) for path in Path("docs/notebooks").glob("*.ipynb")}
    return {"reference/cli.md": cli_page()} | made


def cli_page() -> str:
    """Every command with its arguments and options, as `cfem --help` has them."""
    import typer

    from cfem.cli.app import app
    from cfem.cli.help import GROUPS
    from cfem.core.errors import EXIT_CODES

    group = typer.main.get_command(app)
    lines = ["# Command line", "", f"{group.help}", "", "Generated from the code."]
    shown = []
    for title, names in GROUPS.items():
        there = [group.commands[name] for name in names if name in group.commands]
        lines += ["", f"## {title}", "", "| command | what it does |", "|---|---|"]
        lines += [f"| [`cfem {one.name}`](#cfem-{one.name}) | {_cell(one.help)} |" for one in there]
        shown += there
    lines += ["", "## Exit codes", "", "| code | meaning |", "|---|---|"]
    lines += [f"| {code} | {meaning} |" for code, meaning in EXIT_CODES.items()]
    for command in shown:
        lines += ["", *_command(command)]
    return "\n".join(lines) + "\n"


def _command(command: Any) -> Iterator[str]:
    arguments = [one for one in command.params if one.param_type_name == "argument"]
    options = [one for one in command.params if one.param_type_name == "option" and not one.hidden]
    usage = " ".join(one.name.upper() if one.required else f"[{one.name.upper()}]" for one in arguments)
    yield from (f"## cfem {command.name}", "", command.help or "", "", f"    cfem {command.name} [OPTIONS] {usage}", "")
    if command.epilog:
        yield from (re.sub(r"(cfem \S+ pipelines/.*)", r"`\1`", command.epilog), "")
    yield from ("| argument or option | what it is |", "|---|---|")
    for one in (*arguments, *options):
        name = ", ".join(f"`{flag}`" for flag in one.opts) if one in options else f"`{one.name.upper()}`"
        about = (
            "required" if one.required else "" if one.default in (None, False) else f"default {_code(str(one.default))}"
        )
        yield f"| {name} | {_cell(one.help)}{f'<br><small>{about}</small>' if about else ''} |"


def spec_page(name: str, schema: dict[str, Any]) -> str:
    """Every key of one spec: type, default, description; its parts below."""
    lines = [f"# {name}.yaml", "", schema.get("description", ""), "", "Generated from the code.", ""]
    lines += ["## Top level", "", *(_kinds(schema) if "oneOf" in schema else _table(schema))]
    for part, definition in sorted(schema.get("definitions", {}).items()):
        lines += ["", f"## {part}", "", definition.get("description", ""), "", *_table(definition)]
    return "\n".join(lines) + "\n"


def notebook_page(path: Path) -> str:
    """A notebook with what it printed when scripts/notebooks.py ran it."""
    lines = []
    for cell in json.loads(path.read_text())["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines += [text, ""]
            continue
        lines += ["```python", text.removesuffix(";"), "```", ""]
        printed = "".join("".join(one.get("text", "")) for one in cell["outputs"] if one.get("name") == "stdout")
        lines += ["```text", printed.rstrip(), "```", ""] if printed else []
    return "\n".join([*lines, f"[Download this notebook]({path.name})", ""])


def _kinds(schema: dict[str, Any]) -> Iterator[str]:
    """Of a spec of several kinds: what each is for."""
    for kind in schema["oneOf"]:
        part = kind["$ref"].rsplit("/", 1)[1]
        yield f"- {_type(kind)}: {schema['definitions'][part]['description']}"


def _table(schema: dict[str, Any]) -> Iterator[str]:
    if "properties" not in schema:
        yield f"`{', '.join(map(str, schema.get('enum', [])))}`"
        return
    yield from ("| key | what it is |", "|---|---|")
    required = schema.get("required", [])
    for key, field in schema["properties"].items():
        text, kind = KIND.fullmatch(" ".join(field.get("description", "").split())).groups()
        default = field.get("default")
        about = "required" if key in required else "" if default in (None, [], {}, "") else f"default {_code(default)}"
        about = "; ".join(part for part in (kind or _type(field), about) if part)
        yield f"| `{key}` | {_cell(text)}<br><small>{_cell(about)}</small> |"


def _type(field: dict[str, Any]) -> str:
    """Of a key's value, in words; parts link to their table."""
    if "$ref" in field:
        part = field["$ref"].rsplit("/", 1)[1]
        return f"[{part}](#{part.lower()})"
    for key in ("anyOf", "oneOf", "allOf"):
        if key in field:
            kinds = [_type(one) for one in field[key] if one.get("type") != "null"]
            return " or ".join(dict.fromkeys(kinds))
    if "const" in field:
        return _code(field["const"])
    if "enum" in field:
        return ", ".join(_code(one) for one in field["enum"])
    if field.get("type") == "array":
        return f"list of {_type(field.get('items', {}))}"
    if field.get("maxProperties") == 1:
        return "numbers under a unit"
    if field.get("type") == "object" and isinstance(field.get("additionalProperties"), dict):
        return f"mapping of names to {_type(field['additionalProperties'])}"
    if "e.g. '" in field.get("description", ""):
        return "quantity"
    if field.get("format") == "path":
        return "path"
    kinds = field.get("type", "any value")
    return " or ".join(WORDS.get(kind, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds))


def _code(value: Any) -> str:
    return f"`{value if isinstance(value, str) else json.dumps(value)}`".replace("|", "\\|")


def _cell(text: str | None) -> str:
    return " ".join((text or "").split()).replace("|", "\\|")
