"""Random contact problems of up to 30 points: how many are solved, and is any answer wrong?

python benchmarks/contact_random.py [--problems 1000]

The compliance of a body with a few soft modes and local ones, as a skin has, or of a full random matrix; points near,
in and beyond what they meet; friction from 0 to 1.5. Every answer is checked for gap, force, cone, dissipation and
balance by `cfem.contact.law.check`, which knows nothing of how it was found."""

import argparse
import time
from collections import Counter

import numpy as np

from cfem.contact.law.check import check
from cfem.contact.law.problem import ContactProblem
from cfem.contact.law.solve import ContactStatus, solve_contact

MODES, FRICTION = (3, 10, 30), (0.0, 0.2, 0.5, 0.8, 1.5)


def a_problem(seed: int) -> ContactProblem:
    rng = np.random.default_rng(seed)
    m, mu = 1 + seed % 30, float(rng.choice(FRICTION))
    modes = rng.normal(size=(3 * m, int(rng.choice(MODES))))
    local = np.kron(np.eye(m), np.diag([1.0, 0.8, 0.8]))
    scale = 10.0 ** rng.uniform(-3, 1)  # mm/N
    free = rng.normal(size=3 * m)
    free[::3] -= rng.uniform(0, 1)
    return ContactProblem(scale * (modes @ modes.T + 10.0 ** rng.uniform(-2, 0) * local), free, mu=mu)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=1000)
    given = parser.parse_args()
    statuses, worst, wrong, spent = Counter(), 0.0, 0, []
    for seed in range(given.problems):
        problem = a_problem(seed)
        begin = time.process_time()
        found = solve_contact(problem, "coulomb")
        spent.append(time.process_time() - begin)
        statuses[found.status] += 1
        if found.status is ContactStatus.SOLVED:
            residual = check(problem, "coulomb", found.lam, found.xi).largest
            worst, wrong = max(worst, residual), wrong + (not residual <= 1e-8)
        else:
            print(f"  problem {seed}: {problem.m} points, friction {problem.mu}: {found.status.value}", flush=True)
    for status, count in statuses.most_common():
        print(f"{count:5d} of {given.problems}: {status.value}")
    print(f"largest residual of law and balance {worst:.1e}; wrong answers {wrong}")
    print(f"processor time: median {1e3 * np.median(spent):.2f} ms, largest {max(spent):.1f} s")


if __name__ == "__main__":
    main()
