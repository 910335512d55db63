"""How far the search for a gait comes with how many gaits tried, for several seeds of what it draws.

python benchmarks/gaits.py [CONTROL] [--seeds 5] [--evaluations 24]

CONTROL: control.yaml of a crawler (pipelines/crawler/control.yaml), whose mesh and model are made. Prints, for each
seed, the distance of the best gait so far in mm a cycle, and the CPU seconds until then."""

import argparse
from pathlib import Path
from time import process_time

from cfem.control.crawling.gait import Gait, best_gait
from cfem.control.crawling.stage import GaitSetting, setting_of
from cfem.control.spec import ControlSpec
from cfem.core.spec import load_spec

AFTER = (1, 2, 4, 7, 12, 18, 24, 40, 60)  # evaluations


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("control", nargs="?", type=Path, default=Path("pipelines/crawler/control.yaml"))
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--evaluations", type=int, default=24)
    args = parser.parse_args()
    spec, base = load_spec(args.control, ControlSpec), args.control.parent
    at = setting_of(spec, base, base / spec.mesh, {name: base / path for name, path in spec.models.items()})
    print("mm a cycle (CPU seconds) after so many gaits: ", *(f"{n:12d}" for n in AFTER if n <= args.evaluations))
    for seed in range(1, args.seeds + 1):
        found = search(at, args.evaluations, seed)
        print(f"seed {seed:38d}", *(f"{found[n - 1]:>12}" for n in AFTER if n <= len(found)), flush=True)


def search(at: GaitSetting, evaluations: int, seed: int) -> list[str]:
    """The best so far after each gait."""
    begin, best, found = process_time(), 0.0, []

    def distance(gait: Gait) -> tuple[float, float]:
        nonlocal best
        far, least = at.on.tried(at.learned, gait)
        best = max(best, far) if far == far else best
        found.append(f"{best:.2f} ({process_time() - begin:.0f})")
        return far, least

    best_gait(distance, at.on.n_a, at.on.spec.steps, evaluations, seed)
    return found


if __name__ == "__main__":
    main()
