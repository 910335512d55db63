"""The six files of a new scene, as text."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.init.drive import Drive
from cfem.init.further import Further, further_lines, push_lines
from cfem.init.hold import AXES
from cfem.init.question import Answer
from cfem.init.written import note, number, selection, short, vector

SPECS = ("scene", "sample", "train", "export", "export-page", "control", "report")
ON_PAGE = 8  # actuators for which the page of a robot has room
_FEW, _ROWS, _MORE_ROWS = 3, 60, 100  # training rows for so many cables, and for more

_OF_MANY = """idle: 0.2              # share of the rows in which a cable is slack, as control leaves it where it can
third_order: true      # dW/dlambda too: worth its time from four actuators on
"""


@dataclass(frozen=True)
class NewScene:
    """All that the files say. kind: of the geometry; file: name of the shape's copy; body: of several in it; remesh:
    whether its inside is meshed anew; mended: what was mended, a phrase each; unit: text, None where the file states
    its own; extent (3,) mm; volume mm^3; length mm, along axis; size mm; cells: None where the mesh is the user's;
    element; hold: an Answer, the parts that are held, the first of which it stretches from; young, poisson: each an
    Answer; drive: cables and chambers; further: what else there is; reach: an Answer of each actuator, in mm of cables,
    then in mm^3 of chambers, then in mm of pushes; least: of each actuator, the lower end of its reach; effector: an
    Answer (3,) mm; carrier_radius: mm, of an effector outside the body; self_contact: an Answer,
    yes or no, None where nobody was asked."""

    name: str
    kind: str
    file: str
    body: int
    remesh: bool
    mended: Sequence[str]
    unit: Answer | None
    extent: np.ndarray
    volume: float
    axis: int
    length: float
    size: float
    cells: Answer | None
    element: str
    hold: Answer
    young: Answer
    poisson: Answer
    drive: Drive
    further: Further
    reach: Sequence[Answer]
    least: Sequence[float]
    effector: Answer
    carrier_radius: float | None
    self_contact: Answer | None = None

    @property
    def radius(self) -> float:
        """mm, of the attachments."""
        return self.drive.radius or self.length / 40

    @property
    def n_a(self) -> int:
        """Actuators."""
        return len(self.drive.cables) + len(self.drive.chambers) + len(self.further.pushes)


def texts(robot: NewScene) -> dict[str, str]:
    """File name -> text."""
    writers = (_scene, _sample, _train, _export, _export_page, _control, _report)
    return {
        f"{name}.yaml": f"# yaml-language-server: $schema=../../schemas/{name.split('-')[0]}.json\n{write(robot)}"
        for name, write in zip(SPECS, writers, strict=True)
        if name != "export-page" or _has_page(robot)
    }


def _scene(robot: NewScene) -> str:
    """Text of scene.yaml."""
    kind = robot.kind if robot.unit is None else f"{robot.kind}, unit: {number(robot.unit.value)} mm"
    kind += ", remesh: true" if robot.remesh else ""
    kind += f", body: {robot.body}" if robot.body > 1 else ""
    extent = " x ".join(short(side) for side in robot.extent)
    size = (f"{extent} mm, {short(robot.volume)} mm^3", _guesses(robot.unit) if robot.unit else "")
    lines = [
        f"# The robot, from {robot.file}: `cfem mesh scene.yaml`. Look at what is marked as guessed.",
        *(f"# {robot.file} was mended: {phrase}." for phrase in robot.mended),
        f"name: {robot.name}",
        f"out: ../../data/{robot.name}/mesh",
        f"length: {number(robot.length)} mm{note(f'along {AXES[robot.axis]}; what % of length refers to')}",
        f"geometry: {{kind: {kind}, path: {robot.file}}}" + note("; ".join(part for part in size if part)),
        *_mesh(robot),
        f"material: {{law: neo-hookean-log, young: {robot.young.value}, poisson: {number(robot.poisson.value)}"
        + f"{robot.further.dense}}}"
        + note(_guesses(robot.young, robot.poisson, *robot.further.guessed)),
        *_self_contact(robot.self_contact),
        "fixed:" + note(_guesses(robot.hold)),
        *(f"  - {selection(part)}" for part in robot.hold.value),
        *further_lines(robot.further, robot.radius),
        *_actuators(robot),
    ]
    lines += [
        "effectors:" + note(_guesses(robot.effector)),
        "  - name: tip",
        f"    point: {{mm: {vector(robot.effector.value)}}}",
        f"    radius: {short(robot.radius)} mm",
    ]
    if robot.carrier_radius is not None:
        lines.append(f"    carrier_radius: {short(robot.carrier_radius)} mm" + note("what lies so near carries it"))
    return "\n".join(lines) + "\n"


def _self_contact(answer: Answer | None) -> list[str]:
    return ["self_contact: true" + note(_guesses(answer))] if answer and answer.value == "yes" else []


def _actuators(robot: NewScene) -> list[str]:
    """Lines of the actuators in scene.yaml; without any a comment that has to be filled in."""
    driven, reach = robot.drive, zip(robot.least, robot.reach, strict=True)
    if not robot.n_a:
        return [*_open_question(robot), "actuators: []"]
    placed = [f"guessed: {why}" for why in (driven.placed, driven.offered) if why]
    lines = [f"# {part}" for part in driven.fewer.split("; ", 1)] if driven.fewer else []
    lines.append("actuators:" + note("; ".join(placed)))
    for cable in driven.cables:
        lines += [
            "  - kind: cable",
            f"    name: {cable.name}",
            f"    pull_point: {{mm: {vector(cable.pull)}}}",
            "    points:",
            "      mm:",
            *(f"        - {vector(point)}" for point in cable.points),
            f"    radius: {short(robot.radius)} mm" + note("of the region through which each point acts"),
            *(["    through_air: true" + note("between its points it leaves the body")] if driven.through_air else []),
            _reach("mm", *next(reach)),
        ]
    for chamber in driven.chambers:
        lines += [
            "  - kind: cavity",
            f"    name: {chamber.name}",
            f"    inside: {{mm: {vector(np.round(chamber.inside, 4))}}}" + note(f"in {short(chamber.volume)} mm^3"),
            "    unilateral: true" + note("it is blown up and never sucked empty"),
            _reach("mm^3", *next(reach)),
        ]
    for push in robot.further.pushes:
        lines += push_lines(push, robot.radius)
        lines.append(_reach("mm", *next(reach)))
    return lines


def _reach(unit: str, least: float, most: Answer) -> str:
    others = ["below 0: let out, as far as others move it"] if least < 0 else []
    why = "; ".join([*([_guesses(most)] if most.guess else []), *others])
    return f"    reach: {{{unit}: [{short(least) if least else 0}, {number(most.value)}]}}" + note(why)


def _open_question(robot: NewScene) -> list[str]:
    """Place where the actuators go, as a comment that need only be filled in."""
    low = vector([0.0] * 3)
    return [
        f"# OPEN: what drives the robot? {robot.drive.missing}.".replace("..", "."),
        "# Replace `actuators: []` below by cables or chambers such as these. `cfem mesh` works without, the stages",
        "# after it need an actuator.",
        "# actuators:",
        "#   - kind: cable",
        "#     name: cable-1",
        f"#     pull_point: {{mm: {low}}}          # where it is pulled, outside the body or at its end",
        f"#     points: {{mm: [{low}, {low}]}}    # of the body, in order",
        f"#     radius: {short(robot.radius)} mm",
        "#     through_air: false                  # true: it leaves the body between its points",
        f"#     reach: {{mm: [0, {short(robot.length / 20)}]}}",
        "#   - {kind: cavity, name: chamber-1, inside: {mm: [0, 0, 0]}, unilateral: true, reach: {mm^3: [0, 1000]}}",
    ]


def _mesh(robot: NewScene) -> list[str]:
    """Lines of the mesh in scene.yaml."""
    if robot.cells is None:
        return [
            f"mesh: {{size: {number(robot.size)} mm, element: {robot.element}}}"
            + note("the file's own cells as they are")
        ]
    return [
        "mesh:",
        f"  size: {number(robot.size)} mm" + note("the largest"),
        f"  cells: {robot.cells.value}" + note("about so many, finest where they matter; more: more accurate, slower"),
        *([f"  mirror: {robot.further.symmetry}"] if robot.further.symmetry else []),
    ]


def _sample(robot: NewScene) -> str:
    """Text of sample.yaml."""
    rows = _ROWS if robot.n_a <= _FEW else _MORE_ROWS
    more = _OF_MANY if robot.n_a > _FEW else ""
    return f"""# The states to solve: `cfem sample sample.yaml`. No cable ever pushes, no chamber ever sucks.
scene: scene.yaml
mesh: ../../data/{robot.name}/mesh
out: ../../data/{robot.name}/samples
space: pulling
{more}splits:
  train: {{rows: {rows}, method: scrambled-halton, seed: 1}}     # what the model is fitted to; more rows extend the set
  test: {{rows: 50, method: random, seed: 2}}                # what it is judged by
"""


def _train(robot: NewScene) -> str:
    return f"""# The energy model, fitted without epochs: `cfem train train.yaml`.
dataset: ../../data/{robot.name}/samples
out: ../../models/{robot.name}/spectral
model: {{kind: spectral}}
learning_curve: [20, 40]       # would fewer samples have done?
"""


def _export(robot: NewScene) -> str:
    return f"""# Plain arrays, ONNX and TorchScript: `cfem export export.yaml`.
model: ../../models/{robot.name}/spectral
out: ../../models/{robot.name}/spectral-export
"""


def _has_page(robot: NewScene) -> bool:
    return robot.n_a <= ON_PAGE


def _export_page(robot: NewScene) -> str:
    return f"""# The robot to move, one file that any browser opens: `cfem export export-page.yaml`.
model: ../../models/{robot.name}/spectral
out: ../../models/{robot.name}/page
formats: [html]
"""


def _control(robot: NewScene) -> str:
    """Text of control.yaml."""
    return f"""# Goals to follow with the learned model, in the finite-element robot: `cfem control control.yaml`.
scene: scene.yaml
mesh: ../../data/{robot.name}/mesh
models:
  spectral: ../../models/{robot.name}/spectral-export
out: ../../data/{robot.name}/control
trajectories:
  closed-curve:                # where the tip goes when the shares of all actuators' reach circle: reachable
    kind: image
    centre: 0.45
    radii: 0.3
    goals: 24
"""


def _report(robot: NewScene) -> str:
    """Text of report.yaml."""
    page = f"page: ../../models/{robot.name}/page          # the robot to move, beside the report\n"
    return f"""# One page on all of it: `cfem report report.yaml`.
scene: scene.yaml
mesh: ../../data/{robot.name}/mesh
samples: ../../data/{robot.name}/samples
models:
  spectral: ../../models/{robot.name}/spectral
control: ../../data/{robot.name}/control
{page if _has_page(robot) else ""}out: ../../data/{robot.name}/report
"""


def _guesses(*answers: Answer) -> str:
    whys = [answer.guess for answer in answers if answer.guess is not None]
    return f"guessed: {'; '.join(whys)}" if whys else ""
