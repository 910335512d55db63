"""Spec of control over time: the goals, the loop, and the robot in it."""

from typing import Literal

from cfem.control.closed_loop.spec import LoopSpec
from cfem.control.task.run_spec import FE_BASED, FamilySpec
from cfem.robot.mesh.error_spec import MeshErrorSpec


class ClosedLoopSpec(FamilySpec):
    """Control over time: a controller turns a goal into a command at every tick, with feedback or without."""

    plant: Literal["fem", "model", "device"] = "fem"
    """What the commands act on: fem, the finite-element robot; model, the first model itself, for trying out; device,
    your own."""
    loop: LoopSpec
    """The closed loop: controllers and their clock, the sensors, and the plant. `search` above is what happens within a
    tick."""
    fe_based: bool = False
    """Of no effect here: a controller of the loop says `model: fe-based`."""
    mesh_error: MeshErrorSpec | None = MeshErrorSpec()
    """Of no effect here: a loop has no estimate of the discretisation error."""

    def check(self) -> None:
        super().check()
        self._design_fits()
        self._plant_fits()
        self._models_fit()

    def _design_fits(self) -> None:
        controllers = self.loop.controllers.values()
        if self.design and (self.loop.moving or any(controller.moves for controller in controllers)):
            raise ValueError("design does not go with a loop that moves yet")
        if self.design and self.loop.estimate:
            raise ValueError("design does not go with loop.estimate yet")
        if self.design and any(controller.adapt for controller in controllers):
            raise ValueError("design states what adapt would find: leave one of them out")

    def _models_fit(self) -> None:
        unknown = {controller.model for controller in self.loop.controllers.values()} - {None, FE_BASED, *self.models}
        if unknown:
            raise ValueError(f"loop.controllers: models {sorted(unknown)} are not among {sorted(self.models)}")
        if self.loop.live and (self.loads or self.plant == "model" or self.runtime == "onnx"):
            raise ValueError("loop.live needs plant: fem or device and runtime: arrays, and does not go with loads")

    def _plant_fits(self) -> None:
        """Checks that the plant has what the loop asks of it."""
        loop, real, estimate = self.loop, self.loop.real, self.loop.estimate
        if (self.plant == "device") != (loop.device is not None):
            raise ValueError("plant: device needs loop.device, and loop.device plant: device")
        if self.plant != "fem" and (real.scene or real.mesh or real.wall):
            raise ValueError("loop.real.scene, loop.real.mesh and loop.real.wall need plant: fem")
        if self.plant != "model" and real.viscosity != 1:
            raise ValueError("loop.real.viscosity needs plant: model; with plant: fem override the scene's material")
        if self.plant != "model" and real.stiffer != 1:
            raise ValueError("loop.real.stiffer needs plant: model; with plant: fem override the scene's material")
        if self.plant == "device" and loop.moving:
            raise ValueError("a device moves as it does: leave out loop.moving with plant: device")
        if estimate is not None and self.plant == "model":
            raise ValueError("loop.estimate needs plant: fem or device, which has markers")
        if estimate is not None and self.plant == "device" and (estimate.lost or estimate.wrong):
            raise ValueError("loop.estimate: a device loses markers as it does; leave out lost and wrong")
