"""What a MuJoCo model holds of a learned robot: its skin, sensors, effectors and actuators."""

import mujoco

from cfem.core.errors import InputError
from cfem.mujoco.geoms import MM
from cfem.predict.protocol import Predictor


def points_of(model: Predictor) -> list[str]:
    """Names of the effectors that have a place."""
    rows = model.rows.effectors
    names = dict.fromkeys(row.rpartition(".")[0] for row in rows)
    return [name for name in names if all(f"{name}.{axis}" in rows for axis in "xyz")]


def rows_of(model: Predictor, point: str) -> list[int]:
    """Three rows of the place of an effector."""
    return [model.rows.effectors.index(f"{point}.{axis}") for axis in "xyz"]


def skin_name(robot: str) -> str:
    """Name of the flex that draws a robot."""
    return f"{robot}.skin"


def control_names(robot: str, model: Predictor) -> list[str]:
    """Names of the actuators of MuJoCo that command a robot's."""
    return [f"{robot}.{actuator}" for actuator in model.rows.actuators]


def add_robot(spec: mujoco.MjSpec, name: str, model: Predictor) -> None:
    """Adds the skin and the sensors of a robot at the site `name`, unless they are there. InputError where there is no
    such site."""
    site = next((each for each in spec.sites if each.name == name), None)
    if site is None:
        known = ", ".join(each.name for each in spec.sites if each.name) or "none"
        raise InputError(f"the MuJoCo model has no site '{name}'", do=f"known are {known}")
    if any(flex.name == skin_name(name) for flex in spec.flexes):
        return
    skin, flex = model.skin, spec.add_flex()
    flex.name, flex.dim, flex.vertbody = skin_name(name), 2, [site.parent.name or "world"]
    flex.vert, flex.elem = (skin.rest / MM).ravel(), skin.triangles.ravel()
    flex.contype = flex.conaffinity = 0
    flex.rgba = [0.9, 0.55, 0.4, 1.0]
    flex.radius = 1e-4
    for sensor in ("force", *points_of(model)):
        stage = mujoco.mjtStage.mjSTAGE_ACC
        spec.add_sensor(name=f"{name}.{sensor}", type=mujoco.mjtSensor.mjSENS_USER, dim=3, needstage=stage)


def robot_mjcf(model: Predictor) -> str:
    """MJCF of a robot, to be attached to others: a body with a site of the robot's name, where it is, its skin and its
    effectors at rest, and an actuator without force for each of its own, whose control is that one's displacement.
    InputError where MuJoCo does not read it."""
    name, spec = model.meta["scene"], mujoco.MjSpec()
    spec.modelname = name
    body = spec.worldbody.add_body(name=name)
    body.add_site(name=name)
    for point in points_of(model):
        body.add_site(name=f"{name}.{point}", pos=model.rest_e[rows_of(model, point)] / MM)
    add_robot(spec, name, model)
    for control, reach in zip(control_names(name, model), model.reach, strict=True):
        actuator = spec.add_actuator(name=control, target=name, trntype=mujoco.mjtTrn.mjTRN_SITE)
        actuator.gear, actuator.gainprm[0] = [0.0] * 6, 0.0
        actuator.ctrllimited, actuator.ctrlrange = True, reach
    try:
        spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(" ".join(str(error).split()), where="the robot in MuJoCo") from None
    return spec.to_xml()
