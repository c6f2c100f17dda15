"""``swgjoint spec``: catalogue-style sheet of a design, map or catalogue drive."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.map_validity_text import doubts, marked, validation_of_sheet
from swgjoint.cli.shared.text import table
from swgjoint.files import Outputs, output_folder
from swgjoint.view.words import words

if TYPE_CHECKING:
    from swgjoint.maps.fit.overlay import Overlay
    from swgjoint.maps.sheet.spec_sheet import SpecSheet

FEW_ANGLES = 3
"""Wave-generator positions of a design's map where every wanted figure is read with the
input locked at the first one, without manufacturing errors."""

_SHOWN_ORDERS = 6


def configure(parser: argparse.ArgumentParser) -> None:
    """Drive, fidelity, keys, output folder."""
    parser.add_argument(
        "drive",
        metavar="FILE|DESIGN|NAME",
        help="map (.swg), design file or bundled name, catalogue name (CSG-25-100)",
    )
    parser.add_argument(
        "--model",
        choices=("ring", "2d", "3d"),
        help="fidelity for a design; default 3d for a design with a cup, else 2d",
    )
    parser.add_argument(
        "--only",
        metavar="KEY,...",
        help="compute no more than these keys need: ratings alone need no finite"
        " elements; stiffness, hysteresis loss and lost motion few positions and no"
        " manufacturing errors; radial stiffness and the fatigue safety factor those in"
        " space; the ratcheting torque is computed only where it is named here",
    )
    parser.add_argument(
        "--measured",
        metavar="LOOP.csv",
        help="lay a measured torque-torsion loop, input locked, over the prediction:"
        " columns torque_Nm and torsion_arcmin or torsion_rad",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write spec.json and spec.png there, with --measured measured.png, too",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Find or build the map and measure it.

    Returns:
        Every key of :data:`swgjoint.maps.sheet.spec_sheet.KEYS` (or those of
        ``--only``), None where the source cannot tell, with the reason in ``missing``;
        ``design``, ``validity``, ``files``, ``wall_s``; ``radial_stiffness`` and
        ``fatigue`` with what stands behind these two figures, where they were computed;
        ``uncertain`` by key what the map misses, ``validation`` of the map against
        unseen solves (null with ``validation_reason``) and ``validation_notes``;
        ``ratcheting`` with the path to the largest torque, or to where it ended;
        ``running`` with what rubs in a design that turns without load; ``measured``
        with --measured, see :meth:`swgjoint.maps.fit.overlay.Overlay.as_dict`.
    """
    start = time.perf_counter()
    folder = output_folder(args.out) if args.out else None
    from swgjoint.maps.sheet.spec_sheet import check_keys, measure_spec, validity

    only = [] if args.only is None else [k.strip() for k in args.only.split(",")]
    keys = check_keys(only)
    loop = None
    if args.measured is not None:
        from swgjoint.maps.fit.measurement import read_loop

        loop = read_loop(args.measured)
    drive, ratings, name = _drive(args, keys, always=loop is not None)
    values, reasons, details = _solid(args, keys, ratings)
    if only:
        _ratcheting(args, keys, values, reasons, details)
    _running(args, keys, reasons, details)
    sheet = measure_spec(
        drive, ratings=ratings, only=keys, known=values, unknown=reasons
    )
    result: dict[str, Any] = {"design": name, **sheet.as_dict(), **details}
    if drive is not None:
        result["validity"] = validity(drive)
        result |= validation_of_sheet(drive, keys)
        if "manufacturing_errors" in drive.info:
            result["validity"]["manufacturing_errors"] = drive.info[
                "manufacturing_errors"
            ]
        label = drive.info.get("label")
        if isinstance(label, dict) and label.get("stress_state"):
            result["validity"]["stress_state"] = label["stress_state"]
        stated = drive.info.get("stated")
        result["stated"] = stated if isinstance(stated, dict) else None
    else:
        result["validity"] = {"level": "design", "ratings": ratings.source}
        result |= validation_of_sheet(None, keys)
    laid = None
    if loop is not None:
        from swgjoint.maps.fit.loop_units import check_units
        from swgjoint.maps.fit.overlay import overlay

        doubts = check_units(args.measured, loop, drive.ratings.rated_torque)
        laid = overlay(drive, loop)
        found = laid.as_dict()
        found["warnings"] = [*doubts, *found["warnings"]]
        result["measured"] = {"file": args.measured, **found}
    result |= {"files": [], "wall_s": time.perf_counter() - start}
    if folder is not None:
        _write(folder, result, sheet, laid)
    return result


def _drive(
    args: argparse.Namespace, keys: tuple[str, ...], *, always: bool
) -> tuple[Any, Any, str]:
    """Map (None where ratings suffice, unless always), ratings and name."""
    from swgjoint.drives.references import find_drive, load_drive
    from swgjoint.gear.catalogue import ratings_of
    from swgjoint.maps.drive_map import DriveMap
    from swgjoint.maps.sheet.spec_sheet import needs_map, needs_turn

    if not needs_map(keys) and not always:
        source = find_drive(args.drive)
        if not isinstance(source, DriveMap):
            return None, ratings_of(source), source.drive.name
        if args.model is None:
            return source, source.ratings, source.name
    turn = needs_turn(keys)
    drive = load_drive(
        args.drive,
        model=args.model,
        angles=None if turn else FEW_ANGLES,
        errors=turn,
        progress=args.progress,
    )
    return drive, drive.ratings, drive.name


def _solid(
    args: argparse.Namespace, keys: tuple[str, ...], ratings: Any
) -> tuple[dict[str, float], dict[str, str], dict[str, Any]]:
    """Figures of the solid model of a design, reasons of those it has not, details."""
    from swgjoint.drives.references import find_drive
    from swgjoint.gear.design.design import Design
    from swgjoint.maps.sheet.spec_sheet import SOLID_KEYS

    wanted = [key for key in SOLID_KEYS if key in keys]
    source = find_drive(args.drive) if wanted else None
    if not isinstance(source, Design):
        return {}, {}, {}
    if args.model not in (None, "3d"):
        reason = f"needs the 3d model, not --model {args.model}"
        return {}, dict.fromkeys(wanted, reason), {}
    from swgjoint.fe.solid.figures.spec_figures import solid_figures

    found = solid_figures(source, wanted, ratings.rated_torque, progress=args.progress)
    return found.values, found.missing, found.details


def _ratcheting(
    args: argparse.Namespace,
    keys: tuple[str, ...],
    values: dict[str, float],
    reasons: dict[str, str],
    details: dict[str, Any],
) -> None:
    """Add the ratcheting torque of a design, or the reason why there is none."""
    from swgjoint.drives.references import find_drive
    from swgjoint.gear.design.design import Design
    from swgjoint.maps.cache import recalled
    from swgjoint.maps.sheet.spec_sheet import RATCHETING_KEY

    source = find_drive(args.drive) if RATCHETING_KEY in keys else None
    if not isinstance(source, Design):
        return
    from swgjoint.fe.plane.ratcheting import ratcheting_path

    path = recalled(
        "figures",
        {"figure": RATCHETING_KEY, "design": source.content_hash()},
        dict[str, Any],
        lambda: ratcheting_path(source, progress=args.progress).as_dict(),
    )
    details["ratcheting"] = path
    if path["passed"]:
        values[RATCHETING_KEY] = path["limit_Nm"]
    else:
        rim = source.circular_spline.outer_rim
        reasons[RATCHETING_KEY] = (
            f"more than {path['limit_Nm']:.4g} N·m (a lower bound, where the search"
            f" ended: {path['outcome']}): the plane has a rigid wave generator, and"
            f" the outside of the circular spline is {rim}"
        )


def _running(
    args: argparse.Namespace,
    keys: tuple[str, ...],
    reasons: dict[str, str],
    details: dict[str, Any],
) -> None:
    """Add what friction of teeth and race takes of the unloaded input of a design.

    A lower bound, a small part of what a drive takes: no figure, but the reason why
    there is none.
    """
    from swgjoint.drives.references import find_drive
    from swgjoint.errors import ComputationError, DesignError
    from swgjoint.gear.design.design import Design
    from swgjoint.maps.fit.friction_bending import without_friction
    from swgjoint.maps.sheet.spec_sheet import SLOW_KEYS

    wanted = [key for key in SLOW_KEYS if key in keys]
    source = find_drive(args.drive) if wanted else None
    if not isinstance(source, Design):
        return
    from swgjoint.fe.rings.running import LEFT_OUT, running_friction

    mu = source.friction.tooth_coefficient
    found, why = None, "nothing rubs with friction.tooth_coefficient = 0"
    if mu:
        try:
            found = running_friction(source)
        except (ComputationError, DesignError) as error:
            why = "; ".join(str(error).splitlines())
    if found is None:
        reasons |= dict.fromkeys(wanted, f"{why}; {without_friction(source)}")
        return
    details["running"] = found.as_dict(mu)
    figures = (found.running_torque(mu), found.starting_torque(mu))
    for key, figure in zip(SLOW_KEYS, figures, strict=True):
        if key in wanted:
            reasons[key] = (
                f"more than {figure:.3g} N·m (friction of teeth and race, a lower"
                f" bound); not modelled: {LEFT_OUT}"
            )


def _write(
    folder: Any,
    result: dict[str, Any],
    sheet: SpecSheet,
    laid: Overlay | None,
) -> None:
    from swgjoint.view.plots.spec import spec_picture

    outputs = Outputs(folder)
    outputs.write("spec.png", lambda: spec_picture(result["design"], sheet))
    if laid is not None:
        from swgjoint.view.plots.overlay import overlay_picture

        outputs.write("measured.png", lambda: overlay_picture(result["design"], laid))
    outputs.write_json("spec.json", result)


def report(result: dict[str, Any]) -> str:
    """Figures with units, the strongest orders, what is missing and why."""
    from swgjoint.gear.catalogue_stated import LOSS_KEYS
    from swgjoint.maps.sheet.spec_sheet import KEYS, TURN_KEYS

    keys = [key for key in KEYS if key in result and key != "orders"]
    stated = result.get("stated") or {}
    header = ("", "predicted", *(["stated"] if stated else []), "")
    rows = []
    for key in keys:
        name, unit = words(key)
        more = [stated.get(key)] if stated else []
        rows.append((name, marked(result, key), *more, unit))
    lines = [f"spec sheet of {result['design']} ({_source(result)})"]
    if rows:
        lines.append(table(rows, header=header))
    if result.get("orders"):
        columns = (
            "kinematic_error_arcmin",
            "transmission_error_arcmin",
            "ripple_percent",
        )
        lines.append("strongest orders per input turn, zero to peak:")
        lines.append(
            table(
                [
                    (f"{line['order']:.6g}", *(line[key] for key in columns))
                    for line in result["orders"][:_SHOWN_ORDERS]
                ],
                header=("", "no load [arcmin]", "rated load [arcmin]", "ripple [%]"),
            )
        )
    error = result["validity"].get("kinematic_error", "none")
    if error not in ("none", "given") and any(key in result for key in TURN_KEYS):
        lines.append(f"kinematic error, of which accuracy and ripple follow, {error}")
    friction = result["validity"].get("friction", "none")
    if friction != "none" and any(key in result for key in LOSS_KEYS):
        speed = result["validity"]["running_speed_rpm"]
        lines.append(
            "losses at the input, back driving at the output; running torque and"
            f" efficiency at {speed:g} rpm, efficiency at rated torque; friction from"
            f" {friction}"
        )
    lines += [*result["validation_notes"], *doubts(result)]
    lines += _details(result)
    if "measured" in result:
        lines += _laid(result["measured"])
    reasons: dict[str, list[str]] = {}
    for key, reason in result["missing"].items():
        reasons.setdefault(reason, []).append(words(key)[0])
    lines += [f"- {', '.join(names)}: {reason}" for reason, names in reasons.items()]
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join(lines)


def _details(result: dict[str, Any]) -> list[str]:
    """What stands behind the figures of the solid model."""
    lines = []
    if radial := result.get("radial_stiffness"):
        bent = radial["large_rotations"]
        lines.append(
            "radial stiffness at mid-face, boss clamped; open edge"
            f" {radial['open_edge_N_mm']:.4g}, load spread over the face width"
            f" {radial['spread_over_face_width_N_mm']:.4g}, large rotations"
            f" {bent['outward_N_mm']:.4g} pulled and {bent['inward_N_mm']:.4g} pressed"
            f" by {bent['force_N']:.3g} N, finer displacements"
            f" {radial['finer_displacements_N_mm']:.4g}, half the elements"
            f" {radial['half_the_elements_N_mm']:.4g}, smooth shell"
            f" {radial['smooth_shell_N_mm']:.4g} N/mm"
        )
    if path := result.get("ratcheting"):
        so_far = "" if path["passed"] else "the search ended with the "
        lines.append(
            f"ratcheting: {so_far}torque largest after"
            f" {path['at_largest_pitches']:.3g} of a pitch with"
            f" {path['at_largest_pairs']} teeth in contact, wave generator rigid and"
            " locked, in the plane"
        )
    if slow := result.get("running"):
        lines.append(
            "running and starting torque: slow, Coulomb friction"
            f" {slow['coefficient']:g} of the teeth ({100.0 * slow['teeth_share']:.3g}"
            " %) and of the rim on its race, a lower bound; left out:"
            f" {slow['left_out']}"
        )
    if found := result.get("fatigue"):
        worst, middle = found["worst_section"], found["mid_face"]
        lines.append(
            f"fatigue at {found['torque_Nm']:.4g} N·m, nominal stress at the roots"
            f" times concentration factors: least at z = {worst['z_mm']:.3g} mm"
            f" ({worst['normal_amplitude_MPa']:.3g} MPa around), {middle['S']:.3g} at"
            f" mid-face ({middle['normal_amplitude_MPa']:.3g} MPa); without factors,"
            f" from the peak there {found['S_without_factors_mid_face']:.3g};"
            f" shell theory {found['shell_theory']['S']:.3g}"
        )
    return lines


def _laid(found: dict[str, Any]) -> list[str]:
    """The measured loop beside the prediction."""
    low, high = found["torque_range_Nm"]
    beyond = "; it leaves the torques of the map" if found["beyond_range"] else ""
    rows = [
        (
            f"{row['segment']}, {row['from_Nm']:.4g} to {row['to_Nm']:.4g} N·m",
            row["K_measured_Nm_rad"],
            row["K_predicted_Nm_rad"],
            row["rms_arcmin"],
            row["largest_arcmin"],
        )
        for row in found["segments"]
    ]
    lines = [
        f"measured loop {found['file']}: {found['samples']} samples, {low:.4g} to"
        f" {high:.4g} N·m{beyond}; drive {found['history']}; residual rms"
        f" {found['rms_arcmin']:.3g}, largest {found['largest_arcmin']:.3g} arcmin",
        table(
            rows,
            header=(
                "",
                "K measured [N·m/rad]",
                "K predicted",
                "residual rms [arcmin]",
                "largest",
            ),
        ),
    ]
    pairs = [
        (words(key)[0], *(found[key][which] for which in ("measured", "predicted")))
        for key in ("hysteresis_loss_arcmin", "lost_motion_arcmin")
    ]
    lines.append(table(pairs, header=("arcmin", "measured", "predicted")))
    return [*lines, *(f"warning: {line}" for line in found["warnings"])]


def _source(result: dict[str, Any]) -> str:
    validity = result["validity"]
    text = f"level {validity['level']}"
    if result["validation"] is None and validity["level"] != "design":
        text += f"; {result['validation_reason'].partition(':')[0]}"
    if validity.get("beyond_range"):
        low, high = validity["torque_range_Nm"]
        text += f"; loop leaves the sampled {low:.4g} to {high:.4g} N·m: continued"
    if "stress_state" in validity:
        text += f"; {validity['stress_state']}"
    if "manufacturing_errors" in validity:
        text += "; manufacturing errors left out"
    return text
