"""Export of an arm with its drives as MJCF that needs no plugin."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from swgjoint import __version__
from swgjoint.drives.attach import DriveSource, attach
from swgjoint.errors import InputError
from swgjoint.files import check_output_file, write_whole
from swgjoint.flags import check_flags
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.native_error import NativeError, native_error, notes_of
from swgjoint.joint.patterns import with_whole_names
from swgjoint.joint.step_damping import StepMode
from swgjoint.models_path import find
from swgjoint.sim.arm.compiling import compile_spec
from swgjoint.sim.arm.number_checks import check_numbers
from swgjoint.sim.arm.opening import open_model
from swgjoint.sim.mjcf_text import model_text
from swgjoint.units import arcmin

LONGEST_STEP = 0.1
"""Longest accepted time step [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MjcfExport:
    """An arm with drives at level ``native``, written as MJCF."""

    path: Path
    """The file."""
    assets: tuple[Path, ...]
    """Meshes, textures and skins, in the folder beside it to which it refers."""
    drives: dict[str, JointDrive]
    """Drives by joint name, in the order of the model."""
    without_drive: tuple[str, ...]
    """Hinges of the arm that have no drive, and remain as in its file."""
    errors: dict[str, NativeError]
    """Difference of each drive from level ``full``, as the file states it."""
    step: float
    """Time step in the file [s]."""


def export_mjcf(
    arm: str | Path,
    path: str | Path,
    drives: DriveSource | Mapping[str, DriveSource],
    *,
    rotor_inertia: float | None = None,
    model: str | None = None,
    step: float | None = None,
    motors: bool = False,
) -> MjcfExport:
    """Write an arm with drives at level ``native`` as MJCF without a plugin.

    Any MuJoCo 4 opens the file, also where swgjoint is not installed. Springs,
    hysteresis and friction of the drives are elements of the engine, see
    :mod:`swgjoint.joint.native`. The arm keeps its actuators, sensors and keyframes,
    see :func:`swgjoint.attach`. A comment at the head of the file states for every
    drive by how much it differs from level ``full``.

    Meshes, textures and skins are copied to the folder ``<name>_assets`` beside the
    file; both can be moved together. Their names contain a hash of their content, so
    that an earlier export of the same name stays complete until the new file replaces
    it.

    Args:
        arm: Path of an MJCF or URDF file, or the name of a bundled arm.
        path: The file to write, which ends in ``.xml``.
        drives: One drive for all hinges, or drives by joint name or pattern as in
            :func:`swgjoint.attach`. Names may omit the suffix ``_joint``.
        rotor_inertia: Inertia of rotor and wave generator about their axis [kg·m²].
            None assumes twice the inertia of each drive's wave generator.
        model: Fidelity of the map of a design: ``ring``, ``2d`` or ``3d``.
        step: Time step [s]; None takes that of the arm's file.
        motors: Whether joints with a drive but without an actuator get a motor
            ``<joint>_motor``, whose input is the torque on the rotor [N·m].

    Returns:
        The files, the drives and their differences from level ``full``.

    Raises:
        InputError: If the arm, a joint, a drive or a value cannot be used, or a file
            cannot be read or written. Nothing is written then.
    """
    check_flags(motors=motors)
    path = check_output_file(path, ".xml")
    source = find(arm, "arms", ".xml", what="arm")
    if path.exists() and path.samefile(source):
        raise InputError(f"output file {str(path)!r} is the arm itself")
    spec = open_model(source)
    check_numbers(compile_spec(spec, where=str(source)), where=str(source))
    if step is not None:
        if not 0.0 < step <= LONGEST_STEP:
            raise InputError(f"step {step:g} s; accepted: > 0 and <= {LONGEST_STEP:g}")
        spec.option.timestep = step
    if not isinstance(drives, Mapping):
        drives = {"*": drives}
    hinges = [
        joint.name for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_HINGE
    ]
    attached = attach(
        spec,
        with_whole_names(spec, drives),
        level="native",
        rotor_inertia=rotor_inertia,
        model=model,
    )
    if motors:
        _add_motors(spec, attached)
    timestep = float(spec.option.timestep)
    errors = {
        name: native_error(drive, timestep=timestep) for name, drive in attached.items()
    }
    folder = path.parent / f"{path.stem}_assets"
    text, files = model_text(spec, attached, folder=folder.name)
    text = f"{_comment(source, attached, errors, timestep)}\n{text}"
    _check(text, {f"{folder.name}/{name}": data for name, data in files.items()})
    _write(path, text, folder, files)
    return MjcfExport(
        path=path,
        assets=tuple(folder / name for name in files),
        drives=attached,
        without_drive=tuple(name for name in hinges if name not in attached),
        errors=errors,
        step=timestep,
    )


def _add_motors(spec: mujoco.MjSpec, drives: Mapping[str, JointDrive]) -> None:
    """Add a motor to every rotor that no actuator turns."""
    moved = {actuator.target for actuator in spec.actuators}
    for name, drive in drives.items():
        if drive.rotor not in moved:
            motor = spec.add_actuator(name=f"{name}_motor", target=drive.rotor)
            motor.trntype = mujoco.mjtTrn.mjTRN_JOINT


def _check(text: str, files: Mapping[str, bytes]) -> None:
    """Reject a text that the engine does not read back."""
    try:
        mujoco.MjModel.from_xml_string(text, dict(files))
    except ValueError as exc:
        line = " ".join(str(exc).split())
        raise InputError(f"MuJoCo does not read the exported model: {line}") from None


def _write(path: Path, text: str, folder: Path, files: Mapping[str, bytes]) -> None:
    """Write the files first, and the text that refers to them last."""
    made = bool(files) and not folder.exists()
    new = [folder / name for name in files if not (folder / name).exists()]
    try:
        if files:
            folder.mkdir(exist_ok=True)
        for target in new:
            write_whole(target, files[target.name])
        write_whole(path, text)
    except BaseException as exc:
        for target in new:
            with suppress(OSError):
                target.unlink()
        if made:
            with suppress(OSError):
                folder.rmdir()
        if isinstance(exc, OSError):
            raise InputError(f"cannot write {folder}: {exc.strerror}") from None
        raise


def _comment(
    source: Path,
    drives: Mapping[str, JointDrive],
    errors: Mapping[str, NativeError],
    step: float,
) -> str:
    """The comment at the head of the file."""
    lines = [
        f"{source.name} with strain wave gears, written by swgjoint {__version__}:"
        " level native, without a plugin.",
        "A drive of JOINT consists of the body and hinge JOINT_rotor (motor side), the"
        " tendons JOINT_drive",
        "and JOINT_corner<k> (springs) and JOINT_hysteresis<k> (Jenkin elements). The"
        " length of each tendon",
        "is the torsion: rotor angle / ratio - joint angle.",
        "",
        "Differences from level full, at equal motor angle and output torque, in slow"
        " motion and up to the",
        "stated torque. The link angle is bounded by the sum of torsion, of what is"
        " left out about its mean,",
        "and of friction on the flexspline. Resonance: without load, link inertia at"
        " qpos0, other joints",
        f"locked, at the time step of {1e3 * step:g} ms, which itself damps native"
        " springs; half the step adds",
        "about half as much. Numbers of the drives have all digits, other numbers six,"
        " as MuJoCo writes them.",
    ]
    for name, drive in drives.items():
        lines += ["", *drive_lines(drive, errors[name])]
    text = "\n  ".join(lines).replace("--", "- -")  # not allowed in a comment
    return f"<!--\n  {text}\n-->".replace("  \n", "\n")


def drive_lines(drive: JointDrive, error: NativeError) -> list[str]:
    """State one drive and its differences from level ``full``, one per line.

    Args:
        drive: The drive.
        error: Its differences from level ``full``.
    """
    return [
        f"joint {drive.joint}: {drive.drive.name}, ratio {drive.ratio:g}, rotor"
        f" {drive.rotor_inertia:g} kg m2",
        f"  torque: up to {error.torque:.4g} N m",
        f"  torsion: within {_round_up(error.torsion / arcmin)} arcmin",
        "  left out, transmission error:"
        f" {_round_up(error.ripple / arcmin)} arcmin peak to peak",
        f"  left out, torque ripple at rated torque: {error.torque_ripple:.3g} N m peak"
        " to peak",
        f"  link angle: within {_round_up(error.link / arcmin)} arcmin",
        f"  resonance: {_mode(error.native)}; full: {_mode(error.full)}",
        *(f"  {note}" for note in notes_of(drive)),
    ]


def _mode(mode: StepMode | None) -> str:
    if mode is None:
        return "none"
    hertz = mode.frequency / (2.0 * np.pi)
    return f"{hertz:.4g} Hz, damping ratio {mode.damping_ratio:.3g}"


def _round_up(bound: float) -> str:
    """A bound >= 0 with three digits, rounded up."""
    text = f"{bound:.3g}"
    if float(text) < bound:
        text = f"{bound + 10.0 ** (np.floor(np.log10(bound)) - 2):.3g}"
    return text
