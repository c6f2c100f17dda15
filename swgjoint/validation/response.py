"""``swgjoint study response``: two-mass frequency response of a joint.

At level ``linear``, resonance and anti-resonance are compared with closed forms. At
level ``full``, the same chirp at increasing torque shows how the resonance shifts with
the amplitude-dependent stiffness and, if the map has it, with hysteresis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from swgjoint.drives.references import load_drive
from swgjoint.errors import InputError
from swgjoint.files import file_name
from swgjoint.maps.drive_map import DriveMap
from swgjoint.pictures import png
from swgjoint.sim.figures.frequency_response import (
    Chirp,
    FrequencyResponse,
    TwoMass,
    frequency_response,
)
from swgjoint.validation.rows import Page, Row, StudyOptions, StudyResult

DRIVE = "CSG-25-100"
LINK_RATIO = 1.0
"""Default link inertia divided by the rotor inertia at the output [-]; at one, both
masses affect the resonance equally."""
ROTOR_INERTIA = 1e-4
"""Default rotor inertia: a small motor with the wave generator [kg·m²]."""
PERIOD = 16.0, 128.0
"""Default and longest period of the chirp [s]; a low anti-resonance requires a period
longer than the default."""
AMPLITUDES = (0.002, 0.02, 0.1, 0.3)
"""Amplitudes of the motor torque, referred to the output and divided by the rated
torque [-]. At resonance the drive torque is larger."""
STEP = 1e-4
"""Time step [s]."""


@dataclass(frozen=True, kw_only=True)
class Predicted:
    """Closed-form frequencies for one stiffness."""

    key: str
    """``K1`` or ``mean``."""
    stiffness: float
    """Torsional stiffness [N·m/rad]."""
    meaning: str
    """Definition of the stiffness."""
    locked: float
    """Anti-resonance: load on the drive with the motor locked [Hz]."""
    free: float
    """Resonance: load and rotor oscillating against each other [Hz]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredResponse:
    """Simulated response of one case, with closed forms and a run at half the step."""

    case: str
    """Level, and the motor torque at level ``full``."""
    response: FrequencyResponse
    half_step: FrequencyResponse | None
    """Response at half the time step; None if it was not computed."""
    expected: tuple[float, float] | None
    """Anti-resonance and resonance in closed form [Hz]; None where the closed forms do
    not apply."""
    reason: str | None = None
    """Remark in the rows of this case."""


def run_response(options: StudyOptions) -> StudyResult:
    """Simulate the response of a joint for every drive.

    ``only`` names drives, maps or designs to use instead of the default drive.

    Raises:
        InputError: If a drive is unknown, if a model is given for a drive that is not a
            design, or if the frequencies are outside the range of the simulation.
    """
    references = options.only or (DRIVE,)
    drives = {
        # the closed forms assume a drive without kinematic error
        name: load_drive(name, model=options.model, kinematic_error_arcmin=0.0)
        for name in references
    }
    rows: list[Row] = []
    pages: dict[str, Page] = {}
    summary: list[str] = []
    predicted: list[dict[str, Any]] = []
    for number, (name, drive) in enumerate(drives.items()):
        masses = _masses(drive, options)
        closed = predictions(drive, masses)
        rows += [row for one in closed for row in _closed_rows(name, one)]
        predicted.append(_described(name, drive, masses, closed))
        summary += _closed_summary(name, drive, masses, closed)
        if options.closed_form:
            continue

        def progress(done: int, first: int = number) -> None:
            each = 1 + len(AMPLITUDES)
            options.progress("chirps", first * each + done, len(drives) * each)

        found = _measured(drive, masses, progress)
        rows += [row for measured in found for row in _rows(name, measured)]
        summary += _summary(name, found)
        picture = partial(response_picture, name, found)
        pages[f"response-{file_name(drive.name)}.png"] = picture
    return StudyResult(
        rows=tuple(rows),
        summary=tuple(summary),
        more={"drives": predicted},
        pages=pages,
    )


def _masses(drive: DriveMap, options: StudyOptions) -> TwoMass:
    """Inertias from the options, with the defaults of the study for missing ones."""
    rotor = options.rotor_inertia or ROTOR_INERTIA
    load = options.load_inertia or LINK_RATIO * drive.ratio**2 * rotor
    return TwoMass(rotor_inertia=rotor, link_inertia=load)


def predictions(drive: DriveMap, masses: TwoMass) -> list[Predicted]:
    """Closed-form frequencies for K1, if known, and for the mean stiffness.

    The mean stiffness is the secant of the torsion curve up to rated torque.

    Args:
        drive: Map of the drive.
        masses: Inertias of rotor and load.
    """
    K1 = drive.spec_sheet(("K1_Nm_rad",))["K1_Nm_rad"]
    kinds = [
        ("K1", K1, f"K1, up to {drive.ratings.T1:.4g} N·m"),
        (
            "mean",
            drive.mean_stiffness,
            f"mean stiffness up to the rated {drive.ratings.rated_torque:.4g} N·m",
        ),
    ]
    return [
        Predicted(
            key=key,
            stiffness=stiffness,
            meaning=meaning,
            locked=masses.antiresonance(stiffness),
            free=masses.resonance(stiffness, drive.ratio),
        )
        for key, stiffness, meaning in kinds
        if stiffness is not None
    ]


def _closed_rows(name: str, one: Predicted) -> list[Row]:
    return [
        Row(
            case=f"{name}, {one.key}",
            quantity=f"{quantity}, motor {state}",
            unit="Hz",
            source_value=getattr(one, state),
            ours=None,
            reason=f"closed form with {one.stiffness:.4g} N·m/rad, {one.meaning}",
        )
        for quantity, state in (("antiresonance", "locked"), ("resonance", "free"))
    ]


def _described(
    name: str, drive: DriveMap, masses: TwoMass, closed: list[Predicted]
) -> dict[str, Any]:
    """Inertias and closed forms for the JSON object."""
    return {
        "drive": name,
        "ratio": drive.ratio,
        "rotor_inertia_kgm2": masses.rotor_inertia,
        "load_inertia_kgm2": masses.link_inertia,
        "stiffness_Nm_rad": {one.key: one.stiffness for one in closed},
        "locked_Hz": {one.key: one.locked for one in closed},
        "free_Hz": {one.key: one.free for one in closed},
    }


def _closed_summary(
    name: str, drive: DriveMap, masses: TwoMass, closed: list[Predicted]
) -> list[str]:
    reflected = drive.ratio**2 * masses.rotor_inertia
    return [
        f"{name}: load {masses.link_inertia:.4g} kg·m², rotor"
        f" {masses.rotor_inertia:.4g} kg·m² ({reflected:.4g} kg·m² at the output, ratio"
        f" {abs(drive.ratio):.4g})",
        *(
            f"{name}: motor locked {one.locked:.2f} Hz (anti-resonance), motor free"
            f" {one.free:.2f} Hz (resonance) with {one.stiffness:.4g} N·m/rad,"
            f" {one.meaning}"
            for one in closed
        ),
    ]


def _measured(
    drive: DriveMap, masses: TwoMass, progress: Any
) -> list[MeasuredResponse]:
    """Simulate level ``linear`` at two time steps, then ``full`` at every amplitude."""

    def expected(stiffness: float) -> tuple[float, float]:
        resonance = masses.resonance(stiffness, drive.ratio)
        return masses.antiresonance(stiffness), resonance

    mean, ratings = drive.mean_stiffness, drive.ratings
    low, high = expected(mean)
    top = min(4.0 * high, 0.05 / STEP)
    period = max(PERIOD[0], 10.0 / low)
    fits = top >= 1.5 * high and period <= PERIOD[1]
    if not fits:
        raise InputError(
            f"drive {drive.name!r} with a rotor of {masses.rotor_inertia:g} kg·m² and a"
            f" load of {masses.link_inertia:g} kg·m²: anti-resonance {low:.3g} Hz,"
            f" resonance {high:.3g} Hz; accepted in the simulation:"
            f" {10.0 / PERIOD[1]:.2g} to {0.05 / STEP / 1.5:.0f} Hz; --closed-form"
            " needs no simulation"
        )
    chirp = Chirp(low=low / 6.0, high=top, period=period)

    def measure(level: str, amplitude: float, step: float) -> FrequencyResponse:
        torque = amplitude * ratings.rated_torque
        return frequency_response(
            drive, masses, chirp, level=level, amplitude=torque, step=step
        )

    least = AMPLITUDES[0]
    found = [
        MeasuredResponse(
            case="linear",
            response=measure("linear", least, STEP),
            half_step=measure("linear", least, 0.5 * STEP),
            expected=(low, high),
        )
    ]
    progress(1)
    peak = float(drive.stiffness(0.0, 0.0, 0.0))
    for amplitude in AMPLITUDES:
        response = measure("full", amplitude, STEP)
        small = amplitude == least and not drive.hysteresis
        found.append(
            MeasuredResponse(
                case=f"full, {100 * amplitude:g} % of rated torque",
                response=response,
                half_step=None,
                expected=expected(peak) if small else None,
                reason=f"largest drive torque {response.largest_torque:.3g} N·m"
                + ("; closed form for the tangent at zero load" if small else ""),
            )
        )
        progress(len(found))
    return found


def _rows(name: str, measured: MeasuredResponse) -> list[Row]:
    rows = []
    for k, quantity in enumerate(("antiresonance", "resonance")):
        finer, closed = measured.half_step, measured.expected
        rows.append(
            Row(
                case=f"{name}, {measured.case}",
                quantity=quantity,
                unit="Hz",
                source_value=None if closed is None else closed[k],
                ours=getattr(measured.response, quantity),
                converged=None if finer is None else getattr(finer, quantity),
                reason=measured.reason,
                more={"peak_rad_s_Nm": measured.response.peak},
            )
        )
    return rows


def _summary(name: str, found: list[MeasuredResponse]) -> list[str]:
    linear, weak, strong = found[0], found[1], found[-1]
    assert linear.expected is not None
    off = max(
        abs(getattr(linear.response, key) / value - 1.0)
        for key, value in zip(
            ("antiresonance", "resonance"), linear.expected, strict=True
        )
    )
    return [
        f"{name}: linear within {100 * off:.2g} % of the closed forms; full: resonance"
        f" {weak.response.resonance:.2f} Hz at {weak.case.split(', ')[1]},"
        f" {strong.response.resonance:.2f} Hz at {strong.case.split(', ')[1]}"
    ]


def response_picture(name: str, found: list[MeasuredResponse]) -> bytes:
    """Plot rotor and link speed per motor torque over frequency, as PNG.

    Args:
        name: Name of the drive, for the titles.
        found: Responses to plot.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True)
    for measured in found:
        response = measured.response
        style = {"color": "k", "ls": "--"} if measured.case == "linear" else {}
        for ax, speed in zip(axes, (response.rotor, response.link), strict=True):
            ax.loglog(
                response.frequency, np.abs(speed), lw=1.0, label=measured.case, **style
            )
    for ax, title in zip(axes, ("rotor speed", "link speed"), strict=True):
        ax.set(title=f"{name}: {title} per motor torque", xlabel="frequency [Hz]")
        ax.set_ylabel("[rad/s per N·m]")
        ax.grid(alpha=0.3, which="both")
    axes[0].legend(fontsize="small")
    return png(figure, dpi=110)
