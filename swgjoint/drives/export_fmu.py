"""Export of a drive as a Functional Mock-up Unit."""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import warnings
import zipfile
from dataclasses import dataclass
from math import pi, sqrt
from pathlib import Path

from swgjoint.drives.attach import DriveSource
from swgjoint.drives.fmu_variables import (
    IDENTIFIER,
    VERSIONS,
    FmuVariable,
    describe_model,
    fixed_variables,
)
from swgjoint.drives.references import load_drive
from swgjoint.drives.rotors import rotor_inertia_of
from swgjoint.errors import ComputationError, InputError
from swgjoint.files import check_output_file, read_regular, write_whole
from swgjoint.joint.plugin import config, friction_numbers
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import vary_with_load

STEP = 1e-3
"""Default of the largest internal step of co-simulation [s]."""
SHORTEST_STEP = 1e-7
"""Shortest internal step that the FMU accepts [s]."""
STEPS_PER_PERIOD = 5
"""Internal steps per period of the torsional vibration below which a warning is given.
"""
SMALLEST_INERTIA = 1e-30
"""Smallest inertia that is accepted, whose reciprocal is a number [kg·m²]."""
LARGEST = 1e10
"""Largest parameter that the FMU accepts, in SI units."""
DEVIATIONS = (
    ("stiffness_deviation", "1", "relative deviation of the potential"),
    ("error_deviation", "1", "relative deviation of the kinematic error"),
    ("motor_angle_shift", "rad", "shift of the pattern along the rotor angle"),
    ("output_angle_shift", "rad", "shift of the pattern along the output angle"),
    ("loss_deviation", "1", "relative deviation of hysteresis and friction"),
)
"""Deviations of a specimen from its map: name, unit and meaning; zero by default."""
FRICTION = (
    ("stiffness", "N.m/rad", "bristle stiffness"),
    ("damping", "N.m.s/rad", "bristle damping"),
    ("coulomb", "N.m", "Coulomb and bending friction without load"),
    ("static", "N.m", "static and bending friction without load"),
    ("stribeck_speed", "rad/s", "Stribeck speed"),
    ("viscous", "N.m.s/rad", "viscous friction"),
    ("load", "1", "friction torque per output torque"),
)
"""Parameters of the friction law: name, unit and meaning."""
_STAMP = (1980, 1, 1, 0, 0, 0)  # the same bytes for the same drive


@dataclass(frozen=True, kw_only=True)
class FmuExport:
    """A drive, written as an FMU."""

    path: Path
    """The file."""
    version: str
    """Version of FMI."""
    variables: tuple[FmuVariable, ...]
    """Variables of the FMU, apart from the time."""
    drive: DriveMap
    """Map of the drive."""


def fmu_library() -> Path:
    """Path of the compiled library that FMUs contain."""
    suffix = {"darwin": ".dylib", "win32": ".dll"}.get(sys.platform, ".so")
    folder = Path(__file__).parents[1] / "fmu"
    names = (f"libswgjoint_fmu{suffix}", "libswgjoint_fmu.so", "swgjoint_fmu.dll")
    return next(
        (folder / name for name in names if (folder / name).exists()), folder / names[0]
    )


def export_fmu(
    drive: DriveSource,
    path: str | Path,
    *,
    version: str = "3.0",
    rotor_inertia: float | None = None,
    load_inertia: float | None = None,
    step: float = STEP,
    model: str | None = None,
) -> FmuExport:
    """Write a drive between a rotor and a load as an FMU.

    The FMU supports model exchange and co-simulation. Inputs are the torques on rotor
    and load; both turn about fixed axes. It evaluates the compiled law of level
    ``full``, as the engine plugin does: in co-simulation by the scheme of the
    integrator ``discrete``, in steps of at most the parameter ``internal_step``; in
    model exchange as torques at the states, with hysteresis and friction moving on at
    the end of each integrator step. The FMU contains the library for this machine's
    operating system and needs neither MuJoCo nor Python.

    Args:
        drive: A map, a design, or the name or path of either.
        path: The file to write, which ends in ``.fmu``.
        version: Version of FMI, ``3.0`` or ``2.0``.
        rotor_inertia: Start value of the rotor's inertia [kg·m²]; None assumes twice
            the inertia of the wave generator.
        load_inertia: Start value of the load's inertia [kg·m²]; None takes that of the
            rotor reflected to the output, i²J.
        step: Start value of ``internal_step`` [s].
        model: Fidelity of the map of a design: ``ring``, ``2d`` or ``3d``.

    Returns:
        The file and its variables.

    Raises:
        InputError: If the drive or a value cannot be used, or the file cannot be
            written.
        ComputationError: If the library is not built.

    Warns:
        UserWarning: If the step does not resolve the torsional vibration.
    """
    path = check_output_file(path, ".fmu")
    if version not in VERSIONS:
        raise InputError(f"FMI version {version!r}; accepted: {', '.join(VERSIONS)}")
    library = fmu_library()
    if not library.exists():
        raise ComputationError(
            f"the library of FMUs is not built ({library} is missing): reinstall"
            " swgjoint with a C++ compiler present"
        )
    source = load_drive(drive, model=model)
    rotor = rotor_inertia_of(source) if rotor_inertia is None else rotor_inertia
    if rotor is None:
        raise InputError(
            f"the rotor inertia of drive {source.name!r} is unknown; set rotor_inertia"
            " (--rotor-inertia) [kg·m²], the inertia of rotor and wave generator about"
            " their axis"
        )
    load = source.ratio**2 * rotor if load_inertia is None else load_inertia
    for name, value, unit, low in (
        ("rotor_inertia", rotor, "kg·m²", SMALLEST_INERTIA),
        ("load_inertia", load, "kg·m²", SMALLEST_INERTIA),
        ("step", step, "s", SHORTEST_STEP),
    ):
        if not low <= value <= LARGEST:
            raise InputError(
                f"{name} {value:g} {unit}; accepted: {low:g} to {LARGEST:g}"
            )

    reflected = source.ratio**2 * rotor
    reduced = reflected * load / (reflected + load)
    damping = 2.0 * source.damping_ratio * sqrt(source.mean_stiffness * reduced)
    frequency = sqrt(source.mean_stiffness / reduced) / (2.0 * pi)
    if step * frequency * STEPS_PER_PERIOD > 1.0:
        warnings.warn(
            f"step {step:g} s: internal steps of this length do not resolve the"
            f" torsional vibration between rotor and load at {frequency:.4g} Hz in"
            " co-simulation; recommended: at most"
            f" {1.0 / (STEPS_PER_PERIOD * frequency):.2g} s (--step)",
            stacklevel=2,
        )
    variables = (
        *fixed_variables(source.ratio),
        *_parameters(source, rotor, load, damping, step),
    )
    keys = config(source, damping=damping)
    numbers = [v.start for v in variables if 20 <= v.reference < 30]
    keys["parameters"] = " ".join(repr(float(number or 0.0)) for number in numbers)
    token = hashlib.sha256(repr((version, sorted(keys.items()))).encode()).hexdigest()
    token = (
        f"{{{token[:8]}-{token[8:12]}-{token[12:16]}-{token[16:20]}-{token[20:32]}}}"
    )
    keys["token"] = token
    members = {
        "modelDescription.xml": describe_model(
            source.name, token, variables, version=version, step=step
        ).encode(),
        "resources/drive.txt": "".join(f"{k} {v}\n" for k, v in keys.items()).encode(),
        _library_name(version): read_regular(library),
        "documentation/licenses/fmi-headers.txt": read_regular(
            library.parent / "fmi" / "LICENSE.txt"
        ),
    }
    write_whole(path, _zipped(members))
    return FmuExport(path=path, version=version, variables=variables, drive=source)


def _parameters(
    drive: DriveMap, rotor: float, load: float, damping: float, step: float
) -> list[FmuVariable]:
    """Parameters of an FMU with their start values."""
    rows = [
        (20, "rotor_inertia", "kg.m2", "inertia of rotor and wave generator", rotor),
        (21, "load_inertia", "kg.m2", "inertia of the load", load),
        (22, "damping", "N.m.s/rad", "damping torque per torsion rate", damping),
        (
            23,
            "numerical_damping",
            "1",
            "coefficient nu1 of the scheme (co-simulation)",
            0.1,
        ),
        (24, "internal_step", "s", "largest internal step (co-simulation)", step),
        *((25 + k, *row, 0.0) for k, row in enumerate(DEVIATIONS)),
    ]
    if drive.friction is not None:
        numbers = friction_numbers(drive)[2:]
        rows += [
            (40 + k, f"friction.{name}", unit, text, float(numbers[k]))
            for k, (name, unit, text) in enumerate(FRICTION)
        ]
    if not vary_with_load(drive.hysteresis):
        for j, element in enumerate(drive.hysteresis):
            at, name = 100 + 2 * j, f"hysteresis[{j + 1}]"
            rows += [
                (
                    at,
                    f"{name}.stiffness",
                    "N.m/rad",
                    "stiffness of the Jenkin element",
                    element.stiffness,
                ),
                (
                    at + 1,
                    f"{name}.yield_torque",
                    "N.m",
                    "yield torque of the Jenkin element",
                    element.yield_torque,
                ),
            ]
    return [
        FmuVariable(reference=r, name=n, unit=u, text=t, start=s)
        for r, n, u, t, s in rows
    ]


def _library_name(version: str) -> str:
    """Name of the library in the FMU, for this machine's operating system."""
    system = {"darwin": "darwin", "win32": "windows"}.get(sys.platform, "linux")
    suffix = {"darwin": ".dylib", "windows": ".dll"}.get(system, ".so")
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    folder = f"{machine}-{system}"
    if version == "2.0":
        folder = {"darwin": "darwin64", "windows": "win64"}.get(system, "linux64")
    return f"binaries/{folder}/{IDENTIFIER}{suffix}"


def _zipped(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            info = zipfile.ZipInfo(name, date_time=_STAMP)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, content)
    return buffer.getvalue()
