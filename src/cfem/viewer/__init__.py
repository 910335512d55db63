"""What draws robots in a browser: one viewer for reports, pages and designs, without a graphics card or a network."""

from importlib.resources import files

SCRIPTS = ("camera.js", "shading.js", "raster.js", "surface.js", "marks.js", "scene.js", "overlay.js")


def script(*more: str) -> str:
    """The viewer in JavaScript, with what `more` does with it, in a scope of its own."""
    return "".join(['(() => {\n"use strict";\n', *(asset(name) for name in SCRIPTS), *more, "})();\n"])


def asset(name: str) -> str:
    """A file of the viewer, as text."""
    return (files("cfem.viewer") / name).read_text(encoding="utf-8")
