"""Orders of convergence on manufactured solutions: prints one JSON object. Usage: convergence.py [--quick]

For each element, law, Poisson's ratio and way of holding the unit cube: cells along its side, errors of displacement
(L2, mm^2.5) and of its gradient (H1, mm^1.5), and their orders from one mesh to the next.
--quick: two coarse meshes of one law, to see that it runs."""

import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

DIVISIONS = {"tet4": (4, 8, 16), "tet10": (2, 4, 8), "tet10p0": (4, 8, 12), "hex8": (4, 8, 16)}
QUICK = {"tet4": (4, 8), "tet10": (2, 4), "tet10p0": (4, 8), "hex8": (4, 8)}


def measured(element: str, law: str, poisson: float, divisions: tuple[int, ...], one_face: bool) -> dict:
    from support.manufactured import family, orders

    begin = time.perf_counter()
    found = family(element, law, poisson, divisions, one_face)
    slopes = orders(found, divisions)
    return {
        "element": element,
        "law": law,
        "poisson": poisson,
        "held": "one face" if one_face else "whole boundary",
        "divisions": divisions,
        "L2": [float(f"{error:.4g}") for error in found[:, 0]],
        "H1": [float(f"{error:.4g}") for error in found[:, 1]],
        "L2_orders": slopes[:, 0].round(3).tolist(),
        "H1_orders": slopes[:, 1].round(3).tolist(),
        "seconds": round(time.perf_counter() - begin, 1),
    }


def main(quick: bool) -> dict:
    from cfem.mechanics.material import LAWS

    if quick:
        return {"neo_hookean": [measured(element, "neo-hookean", 0.3, (2, 4), False) for element in DIVISIONS]}

    fine = [
        measured(element, "neo-hookean", poisson, divisions, one_face)
        for element, divisions in DIVISIONS.items()
        for poisson, one_face in ((0.3, False), (0.45, False), (0.499, False), (0.499, True))
    ]
    others = [
        measured(element, law, 0.3, divisions, False)
        for element, divisions in QUICK.items()
        for law in LAWS
        if law != "neo-hookean"
    ]
    return {"neo_hookean": fine, "other_laws": others}


if __name__ == "__main__":
    print(json.dumps(main("--quick" in sys.argv[1:])))
