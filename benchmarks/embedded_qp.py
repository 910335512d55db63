"""Inverse steps of the finger on an emulated Cortex-M7: OSQP's generated code, and the C active set. Prints one JSON
object.

Usage: embedded_qp.py, with the artefacts of `make embedded` in place"""

import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import osqp
from scipy.sparse import csc_matrix, triu

from cfem.condensed.strokes import ridge_of
from cfem.control.search.inverse import Limits
from cfem.predict.load import load_model

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "models/soft-finger/embedded/c"
MODEL = ROOT / "models/soft-finger/spectral-large"


def compared() -> dict:
    """Instructions on an emulated Cortex-M7, and how far lambda is from the active set's, as a share of its largest."""
    problems = inverse_steps()
    names = ("P", "q", "G", "M", "d", "A", "l", "u")
    sizes = dict(zip(names, (3, 2, 8, 4, 2, 4, 4, 4), strict=True))
    with tempfile.TemporaryDirectory() as place:
        fields = "".join(f" double {name}[{size}];" for name, size in sizes.items())
        rows = [
            "{" + ",".join("{" + ",".join(map(repr, one[name].tolist())) + "}" for name in names) + "}"
            for one in problems
        ]
        text = f"#define PROBLEMS {len(problems)}\nstatic const struct {{{fields}}} problems[PROBLEMS] = {{"
        Path(place, "problems.h").write_text((text + ",\n".join(rows) + "};\n").replace("inf", "HUGE_VAL"))
        found = {
            "active set": emulated(Path(place), ["-I", str(FOLDER)], [FOLDER / "cfem_qp.c", FOLDER / "cfem_active.c"])
        }
        one = problems[0]
        for tolerance in (1e-3, 1e-6, 1e-9):
            generated, full = Path(place, f"{tolerance:g}"), csc_matrix(np.ones((4, 2)))
            full.data = one["G"].copy()  # with its zeros, so that any values fit
            P = np.array([[one["P"][0], one["P"][1]], [one["P"][1], one["P"][2]]])
            program = osqp.OSQP()
            problem = triu(csc_matrix(P), format="csc"), one["q"], full, one["l"], np.minimum(one["u"], 1e30)
            program.setup(*problem, eps_abs=tolerance, eps_rel=tolerance, polishing=False, verbose=False)
            program.codegen(str(generated), parameters="matrices", force_rewrite=True)
            include = [f"-I{generated / part}" for part in (".", "inc/public", "inc/private")]
            sources = [generated / "workspace.c", *(generated / "src").glob("*.c")]
            found[f"osqp {tolerance:g}"] = emulated(Path(place), ["-DOSQP", *include], sources)
    exact = np.array(found["active set"]["x"])
    for one in found.values():
        one["lambda_off"] = float(np.abs(np.array(one.pop("x")) - exact).max() / np.abs(exact).max())
    return found


def inverse_steps() -> list[dict[str, np.ndarray]]:
    """Along a closed curve of the finger: OSQP's P (upper triangle), q, G (by columns), bounds; M, d, A of the same."""
    model = load_model(MODEL)
    limits, ridge = Limits.of(model.reach, np.ones(2, bool)), ridge_of(1e-10, model.reach, model.length)
    found = []
    for angle in np.linspace(0, 2 * np.pi, 40, endpoint=False):
        pulls = [np.array([9 + 5 * np.cos(t), 9 + 5 * np.sin(t)]) for t in (angle, angle + 0.15)]
        at, to = map(model.at_displacement, pulls)
        free_a, free_e = at.delta_free[at.rows.a], at.delta_free[at.rows.e]
        rows = np.vstack([at.W_ea, ridge[:, None] * at.W_aa])
        aim = np.concatenate([to.delta_e - free_e, -ridge * free_a])
        H, f, (low, high) = rows.T @ rows, -rows.T @ aim, (limits.within(at.delta_a, 5.0).delta_a - free_a[:, None]).T
        L = np.linalg.cholesky(H)
        box = limits.lambda_a
        one = {"P": H[np.triu_indices(2)], "q": f, "G": np.vstack([np.eye(2), at.W_aa]).T.ravel(), "M": L.T.ravel()}
        one |= {"d": -np.linalg.solve(L, f), "A": at.W_aa.ravel()}
        found.append(one | {"l": np.append(box[:, 0], low), "u": np.append(box[:, 1], high)})
    return found


def emulated(place: Path, options: list[str], sources: list[Path]) -> dict:
    program = str(place / "qp.elf")
    target = ["-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-mthumb"]
    board = ["--specs=rdimon.specs", "-nostartfiles", "-T", str(FOLDER / "mps2.ld"), str(FOLDER / "mps2_startup.c")]
    files = [str(Path(__file__).with_name("embedded_qp.c")), *map(str, sources)]
    compiler = ["arm-none-eabi-gcc", "-std=gnu99", "-O2", *target, "-ffunction-sections", "-Wl,--gc-sections", "-w"]
    subprocess.run([*compiler, f"-I{place}", *options, *board, *files, "-lm", "-o", program], check=True)
    machine = ["qemu-system-arm", "-M", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none"]
    machine += ["-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel", program]
    lines = [
        line.split() for line in subprocess.run(machine, check=True, capture_output=True, text=True).stdout.splitlines()
    ]
    rows, cost = [line[1:] for line in lines if line[0] == "x"], next(line for line in lines if line[0] == "cost")
    iterations = [int(row[2]) for row in rows]
    found = {"instructions_median": int(cost[1]), "instructions_max": int(cost[2]), "iterations_max": max(iterations)}
    return found | {"x": [[float(row[0]), float(row[1])] for row in rows]}


if __name__ == "__main__":
    print(json.dumps(compared(), indent=1))
