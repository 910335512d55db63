"""modelDescription.xml and buildDescription.xml of FMI 3.0."""

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring  # nosec B405: written, never read

from cfem.core.version import VERSION
from cfem.export.fmu.variables import Blocks, Variable

UNITS = {  # exponents of SI units, and factor
    "mm": ({"m": 1}, 1e-3),
    "mm^3": ({"m": 3}, 1e-9),
    "rad": ({"rad": 1}, 1.0),
    "N": ({"kg": 1, "m": 1, "s": -2}, 1.0),
    "N mm": ({"kg": 1, "m": 2, "s": -2}, 1e-3),
    "MPa": ({"kg": 1, "m": -1, "s": -2}, 1e6),
    "s": ({"s": 1}, 1.0),
}


@dataclass(frozen=True)
class Fmu:
    """identifier: of the binary, a word of C; tick: s, of which steps are multiples, None where steps are free;
    longest: s, of the steps of a robot that moves, None of others; moves: whether the robot does."""

    identifier: str
    description: str
    blocks: Blocks
    tick: float | None
    longest: float | None
    moves: bool

    @property
    def variables(self) -> list[Variable]:
        """Variables by value reference, from 1 on; time is 0."""
        return [variable for block in self.blocks.values() for variable in block]


def model_description(fmu: Fmu, token: str) -> bytes:
    """Text of modelDescription.xml of FMI 3.0; token: the hash of what the FMU was made of."""
    root = Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=fmu.identifier,
        instantiationToken=token,
        description=fmu.description,
        generationTool=f"cfem {VERSION}",
        variableNamingConvention="structured",
    )
    able = {"modelIdentifier": fmu.identifier, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
    if "STATE" in fmu.blocks:
        SubElement(root, "ModelExchange", able)
    simulation = SubElement(
        root,
        "CoSimulation",
        able,
        canHandleVariableCommunicationStepSize="true" if fmu.tick is None else "false",
    )
    if fmu.tick is not None:
        simulation.set("fixedInternalStepSize", repr(fmu.tick))
    units = SubElement(root, "UnitDefinitions")
    for name in sorted({"s", *(variable.unit for variable in fmu.variables if variable.unit)}):
        exponents, factor = UNITS[name]
        base = {unit: str(power) for unit, power in exponents.items()}
        SubElement(SubElement(units, "Unit", name=name), "BaseUnit", base | {"factor": repr(factor)})
    categories = SubElement(root, "LogCategories")
    for name in ("logStatusError", "logStatusWarning"):
        SubElement(categories, "Category", name=name)
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize=repr(fmu.tick or 0.01))
    variables, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous", "unit": "s"}
    SubElement(variables, "Float64", time)
    states = len(fmu.blocks.get("STATE", ()))
    for reference, variable in enumerate(fmu.variables, start=1):
        SubElement(variables, "UInt32" if variable.counts else "Float64", _attributes(variable, reference, states))
        if not variable.input and not variable.state:
            SubElement(structure, "Output", valueReference=str(reference))
    for reference, variable in enumerate(fmu.variables, start=1):
        if variable.derivative:
            SubElement(structure, "ContinuousStateDerivative", valueReference=str(reference))
    for reference, variable in enumerate(fmu.variables, start=1):
        if not variable.input:
            SubElement(structure, "InitialUnknown", valueReference=str(reference))
    return _bytes(root)


def _attributes(variable: Variable, reference: int, states: int) -> dict[str, str]:
    """states: their number, by which they come before their derivatives."""
    attributes = {"name": variable.name, "valueReference": str(reference), "description": variable.description}
    attributes |= {
        "causality": "local" if variable.state else "input" if variable.input else "output",
        "variability": "discrete" if variable.counts else "continuous",
    }
    if variable.input:
        shown = "NaN" if variable.missing else repr(int(variable.start) if variable.counts else float(variable.start))
        attributes["start"] = shown
    if variable.derivative:
        attributes["derivative"] = str(reference - states)
    return attributes | {"unit": variable.unit} if variable.unit else attributes


def build_description(identifier: str, sources: Sequence[str]) -> bytes:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = SubElement(build, "SourceFileSet", language="C99")
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    SubElement(build, "Library", name="m", external="true", description="of C, where it is a library of its own")
    return _bytes(root)


def _bytes(root: Element) -> bytes:
    indent(root)
    return tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
