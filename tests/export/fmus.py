"""FMUs of robots made by hand, and one of them at work in fmpy."""

import shutil
from pathlib import Path

import fmpy
from export.embedded import export
from fmpy.fmi3 import FMU3Slave

from cfem.export.firmware.motion import write_c_motion
from cfem.export.fmu.pack import write_fmus
from cfem.export.spec import ExportSpec
from cfem.motion.model import MotionModel
from cfem.predict.load import build


def written(
    folder: Path, model: tuple[dict, dict], moving: dict | None = None, fmu: dict | None = None, **control
) -> dict[str, Path]:
    """FMUs by part. moving: arrays of the model's motion."""
    meta, arrays = model
    c = {"controller": control, "vectors": 3}
    export(folder / "c", model, **c)
    if moving is not None:
        write_c_motion(folder / "c", meta, arrays, moving)
        moving = MotionModel(build(meta, arrays), moving, meta["motion"]["viscosity"])
    spec = ExportSpec(model=folder, out=folder, formats=("fmu",), c=c, fmu=fmu or {})
    write_fmus(folder / "fmu", folder / "c", spec, meta, arrays, moving)
    return {path.stem: path for path in (folder / "fmu").glob("*.fmu")}


class Unit:
    """An FMU in fmpy: variables by name. said: what it has logged, with its status."""

    def __init__(self, path: Path, place: Path, begin: bool = True, **values: float):
        self.folder, self.said = place / path.stem, []
        if not self.folder.exists():
            fmpy.extract(str(path), str(self.folder))
        self.description = fmpy.read_model_description(str(self.folder))
        self.variables = {one.name: one for one in self.description.modelVariables}
        simulation = self.description.coSimulation
        self.tick = float(simulation.fixedInternalStepSize or 0)
        token, name = self.description.guid, simulation.modelIdentifier
        self.fmu = FMU3Slave(guid=token, unzipDirectory=str(self.folder), modelIdentifier=name, instanceName="it")
        self.time = 0.0
        self.fmu.instantiate(logMessage=self._log)
        if begin:
            self.begin(**values)

    def _log(self, environment, status, category, message):
        self.said.append((status, message.decode()))

    def begin(self, **values: float) -> None:
        self.fmu.enterInitializationMode(startTime=0.0)
        self.set(values)
        self.fmu.exitInitializationMode()

    def _calls(self, names) -> dict[str, list[str]]:
        kinds: dict[str, list[str]] = {}
        for name in names:
            kinds.setdefault(self.variables[name].type, []).append(name)
        return kinds

    def set(self, values: dict[str, float]) -> None:
        for kind, names in self._calls(values).items():
            references = [self.variables[name].valueReference for name in names]
            getattr(self.fmu, f"set{kind}")(references, [values[name] for name in names])

    def get(self, *blocks: str) -> list[float]:
        """Values of blocks: `goal` stands for goal.tip.x and all others."""
        names = [name for block in blocks for name in self.variables if name == block or name.startswith(f"{block}.")]
        found = {}
        for kind, each in self._calls(names).items():
            references = [self.variables[name].valueReference for name in each]
            found |= dict(zip(each, getattr(self.fmu, f"get{kind}")(references), strict=True))
        return [found[name] for name in names]

    def put(self, block: str, values) -> None:
        names = [name for name in self.variables if name.startswith(f"{block}.")]
        self.set(dict(zip(names, map(float, values), strict=True)))

    def step(self, size: float | None = None) -> None:
        size = size or self.tick or 0.01
        self.fmu.doStep(self.time, size)
        self.time += size

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)
