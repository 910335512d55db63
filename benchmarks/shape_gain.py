"""What twelve parameters gain over three: the best designs of both, by the model and certified by finite elements.

    make finger-shapes && python benchmarks/shape_gain.py

Three: the length of a segment, the height and the joint's height; the others as the scene has them. Twelve: all of
pipelines/finger-shapes. For each objective a search on the model, then one in which finite elements correct it (the
trust region of `refine`), from two starts. Prints a table for docs/design.md, by finite elements but for one column:
the model's error at the best of twelve, as a share of the objective's spread over all designs. --json: all figures,
with the parameters of each design."""

import argparse
import json
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.design.formulation import problem_of
from cfem.design.optimisers.refined import refine_all
from cfem.design.optimisers.search import first_designs
from cfem.design.spec import DesignSpec
from cfem.parametric.differentiable import Differentiable
from cfem.parametric.load import learned
from cfem.robot.load import load_scene_and_mesh

ROOT = Path(__file__).resolve().parents[1]
THREE = ["L", "H", "JH"]


def searched(spec: DesignSpec, base: Path, family: Differentiable, vary: list[str] | None) -> dict:
    """By objective: values by finite elements and by the model, and how the search ended."""
    spec = spec.model_copy(update={"vary": vary})
    problem, _ = problem_of(spec, learned(base / spec.model, base / spec.scene), base / spec.scene, base)
    exact, _ = problem_of(spec.model_copy(update={"by": "fe"}), family, None, base)
    grid = first_designs(problem, spec.grid)
    found = refine_all(spec, problem, exact, grid)
    start = exact.with_slopes(exact.z(exact.p0))[0]
    records = {}
    for i, name in enumerate(problem.names):
        top = found[name].best
        records[name] = {
            "reference": float(start[i]),
            "value": float(top.objectives[i]),
            "model": float(problem(top.z[None]).objectives[0, i]),
            "of_the_models_best": float(found[name].ends[0].first[i]),
            "spread": float(grid.width[i]),
            "residual": top.residual,
            "certified": top.certified,
            "starts_that_agree": f"{found[name].agree} of {len(found[name].ends)}",
            "solves": sum(one.solves for one in found[name].ends),
            "seconds": found[name].seconds,
            "p": dict(zip([one.name for one in problem.family.parameters], problem.p(top.z).tolist(), strict=True)),
        }
    return records


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("spec", type=Path, nargs="?", default=ROOT / "pipelines/finger-shapes/design.yaml")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    base = asked.spec.parent
    spec = load_spec(asked.spec, DesignSpec, ["refine={starts: 2, solves: 15}", "verify=no", "page=false"])
    parameters = learned(base / spec.model, base / spec.scene).parameters
    family = Differentiable(*load_scene_and_mesh(base / spec.scene, base / spec.mesh), parameters)
    three, twelve = (searched(spec, base, family, vary) for vary in (THREE, None))
    if asked.json:
        print(json.dumps({"three": three, "twelve": twelve}, indent=1))
        return
    print(
        "| objective (less is better) | the scene's design | best of 3 | best of 12 | gain of 12 over 3 | "
        "that over the scene's, 12 to 3 | model's error at the best of 12 | "
        "first-order residual, 3 and 12 | starts that agree, 3 and 12 | FE solves, 3 and 12 |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, many in twelve.items():
        few = three[name]
        gain = 100 * (few["value"] - many["value"]) / abs(few["value"])
        more = (few["reference"] - many["value"]) / (few["reference"] - few["value"])
        off = 100 * abs(many["model"] - many["value"]) / many["spread"]
        print(
            f"| {name} | {few['reference']:.4f} | {few['value']:.4f} | {many['value']:.4f} | {gain:.1f} % | "
            f"{more:.1f} times | "
            f"{off:.2g} % of its spread | {few['residual']:.0e}, {many['residual']:.0e} | "
            f"{few['starts_that_agree']}, {many['starts_that_agree']} | {few['solves']}, {many['solves']} |"
        )
        ends = np.array([few["certified"], many["certified"]])
        if not ends.all():
            print(f"(the search of {name} among {'3' if not ends[0] else '12'} parameters ended at no optimum)")


if __name__ == "__main__":
    main()
