"""The C folder of a robot as a library of the Arduino IDE and of PlatformIO: one header, sources, an example."""

import json
import re
import shutil
from pathlib import Path

from cfem.core.artefact.files import disk_errors, write_whole
from cfem.core.version import VERSION
from cfem.export.firmware import c_text
from cfem.export.firmware.copying import copy_sources, target_files

AUTHORS = "The cfem authors"
CATEGORY = "Device Control"  # of those that library.properties may name
WORDS = ("soft robot", "control", "finite elements")
TOO_SHORT = """#if defined(__SIZEOF_DOUBLE__) && __SIZEOF_DOUBLE__ < 8
#error "double has fewer than 8 bytes on this board (as on an AVR): the controller needs a board whose double has 8"
#endif
"""


def write_library(folder: Path, code: Path, meta: dict) -> Path:
    """Writes a library cfem_NAME into `folder` and returns it, cfem_robot_NAME where a header of the C folder is called
    so. code: the C folder; meta: of its model."""
    name = f"cfem_{_identifier(meta['scene'])}"
    if (code / f"{name}.h").exists():
        name = f"cfem_robot_{_identifier(meta['scene'])}"
    place = folder / name
    with disk_errors(place):
        for part in ("src", "examples/Track"):
            (place / part).mkdir(parents=True, exist_ok=True)
        for file in target_files(code):
            shutil.copyfile(code / file, place / "src" / file)
    copy_sources(place / "examples" / "Track", "arduino/Track.ino")
    sketch = place / "examples" / "Track" / "Track.ino"
    write_whole(sketch, sketch.read_bytes().replace(b"cfem_robot.h", f"{name}.h".encode()))
    write_whole(place / "src" / f"{name}.h", _header(name, meta, place / "src").encode())
    sentence = f"Inverse controller of the soft robot {meta['scene']} on its condensed finite-element model."
    paragraph = "Written by cfem export. Needs a board whose double has 8 bytes: not an AVR."
    properties = {
        "name": name,
        "version": VERSION,
        "author": AUTHORS,
        "maintainer": AUTHORS,
        "sentence": sentence,
        "paragraph": paragraph,
        "category": CATEGORY,
        "url": "",
        "architectures": "*",
        "includes": f"{name}.h",
    }
    text = "".join(f"{key}={value}\n" for key, value in properties.items())
    write_whole(place / "library.properties", text.encode())
    card = {
        "name": name,
        "version": VERSION,
        "description": f"{sentence} {paragraph}",
        "keywords": list(WORDS),
        "authors": [{"name": AUTHORS}],
        "license": "Apache-2.0",
        "frameworks": "*",
        "platforms": "*",
        "headers": f"{name}.h",
        "examples": [{"name": "Track", "base": "examples/Track", "files": ["Track.ino"]}],
        "build": {"flags": ["-ffp-contract=fast"]},
    }
    write_whole(place / "library.json", (json.dumps(card, indent=2) + "\n").encode())
    return place


def _header(name: str, meta: dict, sources: Path) -> str:
    """The one header: all those of the C folder that C++ may include."""
    headers = [path.name for path in sorted(sources.glob("cfem*.h")) if 'extern "C"' in path.read_text()]
    guard = f"{name.upper()}_H"
    included = "".join(f'#include "{header}"\n' for header in headers)
    heading = c_text.comment(
        f"{meta['scene']}, kind {meta['kind']}: by cfem export. C and C++ include this header alone."
    )
    return f"{heading}\n#ifndef {guard}\n#define {guard}\n\n{TOO_SHORT}\n{included}\n#endif\n"


def _identifier(name: str) -> str:
    """Name as a part of those of files and macros."""
    return re.sub(r"\W", "_", name, flags=re.ASCII).lower()
