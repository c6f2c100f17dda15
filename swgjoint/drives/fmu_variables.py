"""Variables of an exported FMU and its model description, for FMI 2.0 and 3.0."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

from swgjoint import __version__

VERSIONS = ("3.0", "2.0")
"""Accepted versions of FMI."""
IDENTIFIER = "swgjoint_drive"
"""Model identifier: name of the library in an FMU."""
UNITS: dict[str, dict[str, int]] = {
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N.m.s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "kg.m2": {"kg": 1, "m": 2},
    "s": {"s": 1},
    "1": {},
}
"""Exponents of the SI units, for each unit of the variables."""
STATES = ("motor_angle", "output_angle", "motor_speed", "output_speed")
"""Continuous states, in the order of the library."""


@dataclass(frozen=True, kw_only=True)
class FmuVariable:
    """A variable of the FMU, a number of type Real or Float64."""

    reference: int
    """Value reference, as in ``fmu/model.h``."""
    name: str
    """Name in the model description."""
    unit: str
    """One of :data:`UNITS`."""
    text: str
    """Description."""
    kind: str = "parameter"
    """``parameter``, ``input``, ``output``, ``state``, ``derivative`` or
    ``constant``."""
    start: float | None = None
    """Start value; None if the FMU computes the variable."""


def fixed_variables(ratio: float) -> list[FmuVariable]:
    """Variables that every FMU has, apart from its parameters.

    Args:
        ratio: Signed ratio i of the drive [-].
    """
    rows: list[tuple[int, str, str, str, str, float | None]] = [
        (1, "motor_torque", "N.m", "input", "torque on the rotor", 0.0),
        (2, "load_torque", "N.m", "input", "external torque on the load", 0.0),
        (3, STATES[0], "rad", "state", "rotor angle theta", 0.0),
        (4, STATES[1], "rad", "state", "output angle psi", 0.0),
        (5, STATES[2], "rad/s", "state", "rotor speed", 0.0),
        (6, STATES[3], "rad/s", "state", "output speed", 0.0),
        *(
            (
                7 + k,
                f"der({name})",
                ("rad/s", "rad/s2")[k // 2],
                "derivative",
                f"derivative of {name}",
                None,
            )
            for k, name in enumerate(STATES)
        ),
        (11, "torsion", "rad", "output", "theta/i + e0 - psi", None),
        (12, "transmission_error", "rad", "output", "psi - theta/i", None),
        (13, "output_torque", "N.m", "output", "torque of the drive on the load", None),
        (14, "input_torque", "N.m", "output", "torque of the drive on the rotor", None),
        (
            15,
            "friction_torque",
            "N.m",
            "output",
            "friction torque of the wave generator on the flexspline",
            None,
        ),
        (30, "ratio", "1", "constant", "signed ratio i, output = input / i", ratio),
    ]
    return [
        FmuVariable(reference=r, name=n, unit=u, kind=k, text=t, start=s)
        for r, n, u, k, t, s in rows
    ]


def describe_model(
    name: str,
    token: str,
    variables: Sequence[FmuVariable],
    *,
    version: str,
    step: float,
) -> str:
    """Text of ``modelDescription.xml``.

    Args:
        name: Name of the model.
        token: Instantiation token (FMI 3.0) or GUID (FMI 2.0).
        variables: Variables of the FMU.
        version: One of :data:`VERSIONS`.
        step: Suggested communication step [s].
    """
    new = version == "3.0"
    root = ElementTree.Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": name,
            "instantiationToken" if new else "guid": token,
            "description": "Strain wave gear between a rotor and a load",
            "generationTool": f"swgjoint {__version__}",
            "variableNamingConvention": "structured",
        },
    )
    if not new:
        root.set("numberOfEventIndicators", "0")
    state = "canGetAndSetFMUState" if new else "canGetAndSetFMUstate"
    common = {"modelIdentifier": IDENTIFIER, state: "true"}
    exchange = ElementTree.SubElement(root, "ModelExchange", common)
    if new:
        exchange.set("needsCompletedIntegratorStep", "true")
    steps = ElementTree.SubElement(root, "CoSimulation", common)
    steps.set("canHandleVariableCommunicationStepSize", "true")
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(variable.unit for variable in variables):
        base = ElementTree.SubElement(units, "Unit", {"name": unit})
        exponents = {key: str(value) for key, value in UNITS[unit].items()}
        ElementTree.SubElement(base, "BaseUnit", exponents)
    ElementTree.SubElement(
        root,
        "DefaultExperiment",
        {"startTime": "0", "stopTime": "1", "stepSize": repr(step)},
    )
    model = ElementTree.SubElement(root, "ModelVariables")
    structure = ElementTree.SubElement(root, "ModelStructure")
    if new:
        _write_variables_3(model, variables)
        _write_structure_3(structure, variables)
    else:
        _write_variables_2(model, variables)
        _write_structure_2(structure, variables)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _attributes(variable: FmuVariable) -> dict[str, str]:
    """Attributes that both versions share."""
    causality, variability, initial = {
        "parameter": ("parameter", "fixed", "exact"),
        "input": ("input", "continuous", ""),
        "output": ("output", "continuous", "calculated"),
        "state": ("output", "continuous", "exact"),
        "derivative": ("local", "continuous", "calculated"),
        "constant": ("output", "constant", "exact"),
    }[variable.kind]
    found = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "causality": causality,
        "variability": variability,
        "description": variable.text,
    }
    return found | ({"initial": initial} if initial else {})


def _value(variable: FmuVariable) -> dict[str, str]:
    found = {} if variable.unit == "1" else {"unit": variable.unit}
    if variable.start is not None:
        found["start"] = repr(float(variable.start))
    return found


def _state_of(variable: FmuVariable, variables: Sequence[FmuVariable]) -> int:
    """Index of the state whose derivative a variable is."""
    names = [one.name for one in variables]
    return names.index(variable.name.removeprefix("der(").removesuffix(")"))


def _write_variables_3(
    model: ElementTree.Element, variables: Sequence[FmuVariable]
) -> None:
    ElementTree.SubElement(
        model,
        "Float64",
        {
            "name": "time",
            "valueReference": "0",
            "causality": "independent",
            "variability": "continuous",
            "unit": "s",
        },
    )
    for variable in variables:
        keys = _attributes(variable) | _value(variable)
        if variable.kind == "derivative":
            state = variables[_state_of(variable, variables)]
            keys["derivative"] = str(state.reference)
        ElementTree.SubElement(model, "Float64", keys)


def _write_variables_2(
    model: ElementTree.Element, variables: Sequence[FmuVariable]
) -> None:
    for variable in variables:
        one = ElementTree.SubElement(model, "ScalarVariable", _attributes(variable))
        keys = _value(variable)
        if variable.kind == "derivative":
            keys["derivative"] = str(_state_of(variable, variables) + 1)
        ElementTree.SubElement(one, "Real", keys)


def _write_structure_3(
    structure: ElementTree.Element, variables: Sequence[FmuVariable]
) -> None:
    def add(kind: str, *kinds: str) -> None:
        for variable in variables:
            if variable.kind in kinds:
                reference = {"valueReference": str(variable.reference)}
                ElementTree.SubElement(structure, kind, reference)

    add("Output", "output", "state", "constant")
    add("ContinuousStateDerivative", "derivative")
    add("InitialUnknown", "output", "derivative")


def _write_structure_2(
    structure: ElementTree.Element, variables: Sequence[FmuVariable]
) -> None:
    def add(kind: str, *kinds: str) -> None:
        section = ElementTree.SubElement(structure, kind)
        for k, variable in enumerate(variables):
            if variable.kind in kinds:
                ElementTree.SubElement(section, "Unknown", {"index": str(k + 1)})

    add("Outputs", "output", "state", "constant")
    add("Derivatives", "derivative")
    add("InitialUnknowns", "output", "derivative")
