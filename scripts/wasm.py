"""The WebAssembly of the page that `cfem export` writes, compiled from src/cfem/export/firmware/sources and page/web:
`make wasm`.

wasm.py writes src/cfem/export/page/web/cfem.wasm, and beside it cfem.json: the hash of each source, of the module, and
with what it was compiled. wasm.py --check compiles too, and exits 5 where the module is another one. The compiler is
pip's wheel of Zig (clang 18, 80 MB), unpacked under build/."""

import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

COMPILER = "ziglang==0.13.0"
EXPORT = Path(__file__).parents[1] / "src/cfem/export"
PLACE = Path(__file__).parents[1] / "build/zig"
WEB, FIRMWARE = "page/web", "firmware/sources"
CODE, RECORD = EXPORT / WEB / "cfem.wasm", EXPORT / WEB / "cfem.json"
INCLUDES = (WEB, *(f"{FIRMWARE}/{folder}" for folder in ("controller", "motion", "mpc")))
SOURCES = (
    f"{WEB}/cfem_page.c",
    f"{WEB}/cfem_page_motion.c",
    *(
        f"{FIRMWARE}/controller/cfem_{name}.c"
        for name in ("controller", "feedback", "condense", "serial", "spectral", "qp", "active", "inverse")
    ),
    *(f"{FIRMWARE}/mpc/cfem_{name}.c" for name in ("mpc", "plan", "program", "tick")),
    *(f"{FIRMWARE}/motion/cfem_{name}.c" for name in ("inertia", "series")),
)
FLAGS = (
    *("-target", "wasm32-freestanding", "-mcpu=generic+bulk_memory", "-nostdlib", "-std=c99", "-O2"),
    *("-ffp-contract=off", "-fno-stack-protector", "-fno-sanitize=all"),
    *("-Wall", "-Wextra", "-Wshadow", "-Werror", *(word for folder in INCLUDES for word in ("-I", folder))),
    *("-Wl,--no-entry", "-Wl,--export=__heap_base", "-Wl,-z,stack-size=262144", "-Wl,--strip-all"),
)


def main() -> int:
    if not (PLACE / "ziglang").exists():
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(PLACE), COMPILER]
        subprocess.run(pip, check=True)
    code = compiled()
    if "--check" in sys.argv:
        same = CODE.read_bytes() == code
        print("the same module" if same else f"another module than {CODE}: run `make wasm`")
        return 0 if same else 5
    CODE.write_bytes(code)
    RECORD.write_text(json.dumps(record(code), indent=1) + "\n")
    print(f"{CODE}: {len(code)} bytes")
    return 0


def compiled() -> bytes:
    """Paths are relative, so that none of this machine is in the module."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "cfem.wasm"
        words = [sys.executable, "-m", "ziglang", "cc", *FLAGS, "-o", str(out), *SOURCES]
        subprocess.run(
            words, cwd=EXPORT, env={"PYTHONPATH": str(PLACE), "HOME": folder, "PATH": "/usr/bin:/bin"}, check=True
        )
        return out.read_bytes()


def record(code: bytes) -> dict:
    """What cfem.json says: a source that changed since is another hash than here."""
    return {"compiler": COMPILER, "flags": FLAGS, "sources": hashes(), "module": _sha256(code)}


def hashes() -> dict[str, str]:
    """Of all sources and headers that go into the module."""
    used = [EXPORT / name for name in SOURCES]
    used += [path for folder in INCLUDES for path in (EXPORT / folder).glob("cfem*.h")]
    used += [EXPORT / WEB / "math.h", EXPORT / WEB / "string.h"]
    return {str(path.relative_to(EXPORT)): _sha256(path.read_bytes()) for path in sorted(used)}


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


if __name__ == "__main__":
    sys.exit(main())
