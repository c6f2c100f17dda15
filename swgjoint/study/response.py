"""``swgjoint study response``: two-mass frequency response of a joint.

At level ``linear`` resonance and anti-resonance stand beside their closed forms. At
``full`` the same chirp at rising torque shows what an amplitude-dependent stiffness,
and hysteresis where the map has it, make of the one resonance.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.errors import InputError
from swgjoint.files import write_whole
from swgjoint.json_text import json_text
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.drives import load_drive
from swgjoint.sim.frequency_response import (
    Chirp,
    FrequencyResponse,
    TwoMass,
    frequency_response,
)
from swgjoint.study.rows import Row, StudyOptions, StudyResult

DRIVE = "CSG-25-100"
LINK_RATIO = 1.0
"""Link inertia over the reflected rotor's: both masses take part in the resonance."""
ROTOR_INERTIA = 1e-4  # kg·m², a small motor with its wave generator
AMPLITUDES = (0.002, 0.02, 0.1, 0.3)
"""Motor torque at the output over the rated torque; the resonance multiplies it."""
STEP = 1e-4


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """One response with what it should be and how it changes with the step."""

    case: str
    response: FrequencyResponse
    half_step: FrequencyResponse | None
    expected: tuple[float, float] | None
    """Anti-resonance and resonance in closed form [Hz]."""
    reason: str | None = None


def run_response(options: StudyOptions) -> StudyResult:
    """Chirp one joint; ``only`` names other drives, maps or designs.

    Raises:
        InputError: If a drive is unknown or a fidelity does not fit it.
    """
    references = options.only or (DRIVE,)
    drives = {name: load_drive(name, model=options.model) for name in references}
    rows, summary, files = [], [], []
    for number, (name, drive) in enumerate(drives.items()):

        def progress(done: int, first: int = number) -> None:
            each = 1 + len(AMPLITUDES)
            options.progress("chirps", first * each + done, len(drives) * each)

        found = _measured(drive, progress)
        rows += [row for measured in found for row in _rows(name, measured)]
        summary += _summary(name, found)
        if options.folder is not None:
            options.folder.mkdir(parents=True, exist_ok=True)
            stem = f"response-{drive.name}"
            picture = response_picture(name, found)
            files.append(write_whole(options.folder / f"{stem}.png", picture))
    if options.folder is not None:
        text = json_text([row.to_json() for row in rows]) + "\n"
        files.append(write_whole(options.folder / "response.json", text))
    return StudyResult(
        rows=tuple(rows),
        summary=tuple(summary),
        files=tuple(str(path) for path in files),
    )


def _measured(drive: DriveMap, progress: Any) -> list[Measured]:
    """The linear level at two steps, then ``full`` at every amplitude."""
    reflected = drive.ratio**2 * ROTOR_INERTIA
    masses = TwoMass(rotor_inertia=ROTOR_INERTIA, link_inertia=LINK_RATIO * reflected)

    def expected(stiffness: float) -> tuple[float, float]:
        resonance = masses.resonance(stiffness, drive.ratio)
        return masses.antiresonance(stiffness), resonance

    mean, ratings = drive.mean_stiffness, drive.ratings
    low, high = expected(mean)
    chirp = Chirp(low=low / 6.0, high=min(4.0 * high, 0.05 / STEP))
    if chirp.high < 1.5 * high:
        raise InputError(
            f"drive {drive.name!r}: its resonance with a rotor of {ROTOR_INERTIA:g}"
            f" kg·m², {high:.0f} Hz, needs a step below {1e3 * STEP:g} ms; accepted: up"
            f" to {0.05 / STEP / 1.5:.0f} Hz"
        )

    def measure(level: str, amplitude: float, step: float) -> FrequencyResponse:
        torque = amplitude * ratings.rated_torque
        return frequency_response(
            drive, masses, chirp, level=level, amplitude=torque, step=step
        )

    least = AMPLITUDES[0]
    found = [
        Measured(
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
            Measured(
                case=f"full, {100 * amplitude:g} % of rated torque",
                response=response,
                half_step=None,
                expected=expected(peak) if small else None,
                reason=f"largest torque of the drive {response.largest_torque:.3g} N·m"
                + ("; closed form: tangent without load" if small else ""),
            )
        )
        progress(len(found))
    return found


def _rows(name: str, measured: Measured) -> list[Row]:
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


def _summary(name: str, found: list[Measured]) -> list[str]:
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


def response_picture(name: str, found: list[Measured]) -> bytes:
    """PNG: magnitude of rotor and link speed per torque over frequency."""
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
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return out.getvalue()
