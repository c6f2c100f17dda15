"""``swgjoint profile``: dimensions, checks and plot of the tooth profiles."""

from __future__ import annotations

import argparse
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.text import table
from swgjoint.files import Outputs, output_folder

if TYPE_CHECKING:
    from swgjoint.gear.teeth.profile import ToothProfile

MEMBERS = ("flexspline", "circular_spline")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: design, output folder."""
    parser.add_argument("design", metavar="DESIGN", help="design file or bundled name")
    parser.add_argument(
        "--out", metavar="DIR", help="write profile.json and profile.png to this folder"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Build and check both tooth profiles.

    Returns:
        ``design``; for each member ``teeth``, ``straight_length_mm``, radii, thickness
        at the pitch circle and ``segments``; ``points`` of both right flanks from tip
        to root [mm], shape (n, 2); ``checks``; ``files``.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.teeth.tooth_profile import tooth_profile

    design = Design.load(args.design)
    profiles = {member: tooth_profile(design, member) for member in MEMBERS}
    result: dict[str, Any] = {"design": design.drive.name}
    result |= {member: _numbers(profile) for member, profile in profiles.items()}
    result["points"] = {m: _points(profile) for m, profile in profiles.items()}
    result["checks"] = [
        check | {"member": member}
        for member, profile in profiles.items()
        for check in _checks(profile)
    ]
    result["files"] = []
    if folder is not None:
        from swgjoint.view.plots.profile import profile_picture

        outputs = Outputs(folder)
        outputs.write("profile.png", lambda: profile_picture(design, profiles))
        outputs.write_json("profile.json", result)
    return result


def report(result: dict[str, Any]) -> str:
    """Format the dimensions, one column per member, then the checks."""
    keys = [key for key in result["flexspline"] if key != "segments"]
    rows = [(_label(key), *(result[m][key] for m in MEMBERS)) for key in keys]
    names = dict.fromkeys(s["name"] for m in MEMBERS for s in result[m]["segments"])
    for name in names:
        lengths = [
            next(
                (s["length_mm"] for s in result[m]["segments"] if s["name"] == name), 0
            )
            for m in MEMBERS
        ]
        rows.append((f"length of {_label(name)} [mm]", *lengths))
    text = table(rows, header=("", "flexspline", "circular spline"))
    checks = [
        f"{'ok ' if check['ok'] else 'BAD'} {_label(check['member'])}: {check['name']}"
        f" ({check['value']:.4g} {check['unit']})"
        for check in result["checks"]
    ]
    files = [f"wrote {name}" for name in result["files"]]
    return "\n".join([f"tooth profile of {result['design']}", text, *checks, *files])


def _label(key: str) -> str:
    """A key in words, with the unit of a length in brackets."""
    unit = " [mm]" if key.endswith("_mm") else ""
    return key.removesuffix("_mm").replace("_", " ") + unit


def status(result: dict[str, Any]) -> int:
    """Return 1 if a check failed, else 0."""
    return 0 if all(check["ok"] for check in result["checks"]) else 1


def _numbers(profile: ToothProfile) -> dict[str, Any]:
    from swgjoint.units import mm

    thickness = _width_at_pitch(profile)
    return {
        "teeth": profile.teeth,
        "straight_length_mm": profile.straight_length / mm,
        "pitch_radius_mm": profile.pitch_radius / mm,
        "tip_radius_mm": profile.addendum_radius / mm,
        "root_radius_mm": profile.dedendum_radius / mm,
        "thickness_at_pitch_mm": thickness / mm,
        "segments": [
            {
                "name": part.name,
                "length_mm": part.length / mm,
                "radius_mm": part.radius / mm if part.radius else None,
            }
            for part in profile.segments
        ],
    }


def _width_at_pitch(profile: ToothProfile) -> float:
    """Thickness of the tooth along the pitch circle [m]."""
    import numpy as np
    from scipy.optimize import brentq

    def height(s: float) -> float:
        (point,), _, _ = profile.evaluate(np.array([s]))
        return float(np.hypot(*point)) - profile.pitch_radius

    s = brentq(height, 0.0, float(profile.stations[-1]), xtol=1e-15)
    (point,), _, _ = profile.evaluate(np.array([s]))
    return 2.0 * profile.pitch_radius * float(np.arctan2(point[0], point[1]))


def _points(profile: ToothProfile, per_segment: int = 24) -> list[list[float]]:
    """Points of the flank, including every junction [mm]. Shape (n, 2)."""
    import numpy as np

    from swgjoint.units import mm

    stations = profile.stations
    parts = [
        np.linspace(a, b, per_segment, endpoint=False) for a, b in pairwise(stations)
    ]
    points, _, _ = profile.evaluate(np.concatenate([*parts, stations[-1:]]))
    return [[float(x) / mm, float(y) / mm] for x, y in points]


def _checks(profile: ToothProfile) -> list[dict[str, Any]]:
    """Check that the segments meet, are tangent and have positive lengths."""
    import numpy as np

    from swgjoint.gear.teeth.profile import TANGENCY_RAD
    from swgjoint.units import mm

    junctions, stations = profile.junctions(), profile.stations
    gap = max(junction.gap for junction in junctions)
    corner = max((j.corner for j in junctions if not j.edge), default=0.0)
    shortest = min(part.length for part in profile.segments)
    (last,), _, _ = profile.evaluate(stations[-1:])
    end = abs(float(np.arctan2(last[0], last[1])) - profile.half_pitch)
    return [
        _check("segments meet", gap / mm, "mm", gap < 1e-12),
        _check("junctions are tangent", corner, "rad", corner < TANGENCY_RAD),
        _check("shortest segment", shortest / mm, "mm", shortest > 0),
        _check("flank ends in the middle of the gap", end, "rad", end < 1e-12),
    ]


def _check(name: str, value: float, unit: str, ok: bool) -> dict[str, Any]:
    return {"name": name, "value": value, "unit": unit, "ok": bool(ok)}
