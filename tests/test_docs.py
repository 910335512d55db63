"""The site's hand-written pages agree with the code."""

import re
from pathlib import Path
from types import SimpleNamespace

from support.script import script

from cfem.pipeline.robots import robots

ROOT = Path(__file__).parents[1]


def texts(code):
    """Constants of compiled code: a text with numbers in it is several."""
    for constant in code.co_consts:
        if isinstance(constant, str):
            yield constant
        elif hasattr(constant, "co_consts"):
            yield from texts(constant)


def test_every_message_that_troubleshooting_explains_is_one_of_the_code():
    compiled = [compile(path.read_text(), str(path), "exec") for path in (ROOT / "src").rglob("*.py")]
    said = "\n".join(text for code in compiled for text in texts(code))
    explained = re.findall(r"^### `(.+)`$", (ROOT / "docs" / "troubleshooting.md").read_text(), re.MULTILINE)
    assert len(explained) > 20
    for message in explained:
        for part in re.split(r"[…:']+", message):
            assert part.strip() in said, message


def test_the_map_of_the_tree_names_every_package_and_no_other():
    text = (ROOT / "docs" / "architecture.md").read_text().split("## Packages")[1].split("## The way")[0]
    named = re.findall(r"`(\w+)`", "".join(row.split("|")[1] for row in text.splitlines() if row.startswith("| `")))
    packages = [path.parent.name for path in (ROOT / "src" / "cfem").glob("*/__init__.py")]
    assert sorted(named) == sorted(packages)


def test_every_link_leads_somewhere_in_a_checkout_and_on_the_site(monkeypatch):
    monkeypatch.chdir(ROOT)
    site, broken = script("docs_pages"), []
    generated = site.pages()
    for path in (ROOT / "docs").rglob("*.md"):
        name = path.relative_to(ROOT / "docs").as_posix()
        there = SimpleNamespace(file=SimpleNamespace(src_uri=name))
        shown = site.on_page_markdown(path.read_text(), there, SimpleNamespace(repo_url=None), None)
        broken += [(name, link) for link in links(path.read_text()) if not (path.parent / link).exists()]
        broken += [
            (name, link)
            for link in links(shown)
            if not (path.parent / link).exists()
            and (path.parent / link).resolve().relative_to(ROOT / "docs").as_posix() not in generated
            and not link.startswith("robots/")
        ]
    assert broken == []


def links(text):
    """Targets of links to files, without the place in them."""
    return [link for link in re.findall(r"\]\(([^)\s#]+)[^)]*\)", text) if "://" not in link and "mailto" not in link]


def test_every_page_is_in_the_navigation():
    named = set(re.findall(r"([\w/-]+\.md)", (ROOT / "mkdocs.yml").read_text()))
    assert {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")} <= named


def test_every_page_that_quotes_a_file_does_so_in_the_form_that_the_site_reads():
    quoting = [
        line for path in (ROOT / "docs").rglob("*.md") for line in path.read_text().splitlines() if "--8" in line
    ]
    assert quoting
    for line in quoting:
        found = re.fullmatch(r'--8<-- "([^"]+)"', line.strip())
        assert found and (ROOT / found[1]).exists(), line


def test_every_page_says_first_what_it_is_for():
    for path in (ROOT / "docs").rglob("*.md"):
        lines = [line for line in path.read_text().splitlines() if line.strip()]
        first = lines[lines.index(next(line for line in lines if line.startswith("# "))) + 1]
        assert (first[0] not in "#|!-<" and not first.startswith("```")) or path.stem == "index", path.name


def test_the_front_page_has_a_place_for_the_live_robot():
    pages = script("docs_pages")
    assert len(pages.PICTURE.findall((ROOT / "docs" / "index.md").read_text())) == 1
    assert 'src="robots/soft-finger.html"' in pages.LIVE


def test_the_gallery_has_every_robot_that_can_be_copied_and_says_what_it_is(monkeypatch):
    monkeypatch.chdir(ROOT)
    pages = script("docs_gallery")
    assert sorted(pages.catalogue()) == robots()
    text = pages.gallery()
    for name in robots():
        assert re.search(rf"id=[\"']{name}[\"']", text), name
        assert pages.description(name), name


def test_every_robot_with_a_page_has_a_moving_picture_that_is_small(monkeypatch):
    monkeypatch.chdir(ROOT)
    pages = script("docs_gallery")
    shown = [name for name in pages.catalogue() if pages.page_specs(name)]
    assert len(shown) > 6
    assert [name for name in shown if not pages.moving_picture(name)] == []
    assert sum(path.stat().st_size for path in pages.PICTURES.iterdir()) < 1.5e6


def test_the_front_page_has_six_robots_in_motion_that_the_gallery_has(monkeypatch):
    monkeypatch.chdir(ROOT)
    site, pages = script("docs_pages"), script("docs_gallery")
    [names] = site.IN_MOTION.findall((ROOT / "docs" / "index.md").read_text())
    row = pages.front_row(names.split(", "))
    assert row.count("<img") == 6
    assert set(re.findall(r"gallery.html#([\w-]+)", row)) <= set(robots())


def test_generated_pages_are_in_the_navigation(monkeypatch):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "mkdocs.yml").read_text()
    assert [path for path in script("docs_pages").pages() if path not in text] == []


def test_the_architecture_names_files_that_are_there():
    text = (ROOT / "docs" / "architecture.md").read_text().split("## The way of one value")[1]
    named = set(re.findall(r"`([a-z_0-9]+(?:/[a-z_0-9]+)+(?:\.(?:py|c)|/))`", text))
    assert len(named) > 20
    for name in named:
        assert (ROOT / "src" / "cfem" / name).exists(), name
    sources = {path.name for path in (ROOT / "src/cfem/export/firmware/sources").rglob("*.c")}
    in_c = set(re.findall(r"`(cfem_\w+\.c)`", text))
    assert len(in_c) > 5 and in_c <= sources, in_c - sources


def test_files_and_modules_that_the_pages_name_are_there():
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    text = "\n".join(path.read_text() for path in pages if path.name != "page.md")  # whose `cfem` is the page's own
    files = set(re.findall(r"\b(?:tests|benchmarks|scripts)/[\w/]+\.py\b", text))
    modules = {f"src/cfem{one.replace('.', '/')}" for one in re.findall(r"`cfem((?:\.[a-z_]+){2,})`", text)}
    assert len(files) > 50 and len(modules) > 20
    assert [one for one in sorted(files) if not (ROOT / one).exists()] == []
    assert [one for one in sorted(modules) if not _stands_for_code(ROOT / one)] == []


def _stands_for_code(path):
    """Whether a path is a module, a package, or a name within a module."""
    is_module = path.with_suffix(".py").exists() or path.is_dir()
    return is_module or (
        path.parent.with_suffix(".py").exists() and f" {path.name}" in path.parent.with_suffix(".py").read_text()
    )
