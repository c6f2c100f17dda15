"""``swgjoint spec``: data sheet of a design, a map or a catalogue drive."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.common_options import add_drive, add_model
from swgjoint.cli.shared.map_validity_text import doubts, mark_figure
from swgjoint.cli.shared.text import table
from swgjoint.files import Outputs, output_folder
from swgjoint.gear.ratings import rule_of
from swgjoint.view.ratings_text import sheet_words
from swgjoint.view.words import words

if TYPE_CHECKING:
    from swgjoint.drives.spec_sheet import DriveSheet

_SHOWN_ORDERS = 6
"""Largest number of orders in the table."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: drive, fidelity, keys, measured loop, output folder."""
    add_drive(parser)
    add_model(parser, "a design")
    parser.add_argument(
        "--only",
        metavar="KEY,...",
        help="compute only these keys: ratings need no finite elements; stiffness,"
        " hysteresis loss and lost motion need few positions and no manufacturing"
        " errors; radial stiffness and fatigue safety factor need the 3D model; the"
        " ratcheting torque is computed only if it is listed here",
    )
    parser.add_argument(
        "--measured",
        metavar="LOOP.csv",
        help="compare the prediction with a torque-torsion loop that was measured with"
        " the input locked; columns torque_Nm and torsion_arcmin or torsion_rad",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write spec.json, spec.png and, with --measured, measured.png to this"
        " folder",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Load or build the map and evaluate it.

    Returns:
        The result of :func:`swgjoint.drives.spec_sheet.measure_drive`, and ``files``.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.drives.spec_sheet import measure_drive

    evaluated = measure_drive(
        args.drive,
        model=args.model,
        only=[] if args.only is None else [k.strip() for k in args.only.split(",")],
        measured=args.measured,
        progress=args.progress,
    )
    wall = evaluated.result.pop("wall_s")
    result = {**evaluated.result, "files": [], "wall_s": wall}
    if folder is not None:
        _write(folder, result, evaluated)
    return result


def _write(folder: Any, result: dict[str, Any], evaluated: DriveSheet) -> None:
    from swgjoint.view.plots.spec import spec_picture

    outputs, overlay = Outputs(folder), evaluated.overlay
    outputs.write(
        "spec.png",
        lambda: spec_picture(result["design"], evaluated.sheet, evaluated.efficiency),
    )
    if overlay is not None:
        from swgjoint.view.plots.overlay import overlay_picture

        outputs.write(
            "measured.png", lambda: overlay_picture(result["design"], overlay)
        )
    outputs.write_json("spec.json", result)


def report(result: dict[str, Any]) -> str:
    """Format the values, the strongest orders, remarks and missing values."""
    from swgjoint.gear.catalogue_stated import LOSS_KEYS
    from swgjoint.maps.sheet.spec_sheet import KEYS, LOOP_KEYS, TURN_KEYS

    keys = [key for key in KEYS if key in result and key != "orders"]
    ratings = result["validity"]["ratings"]
    stated = result.get("stated") or {}
    header = ("", "predicted", *(["stated"] if stated else []), "")
    rows = []
    for key in keys:
        name, unit = sheet_words(key, ratings)
        more = [stated.get(key)] if stated else []
        rows.append((name, mark_figure(result, key), *more, unit))
    lines = [f"spec sheet of {result['design']} ({_source(result)})"]
    if rows:
        lines.append(table(rows, header=header))
    if set(keys) & set(rule_of(ratings)[0]):
        lines.append(f"by rule: {rule_of(ratings)[1]}")
    if result.get("orders"):
        columns = (
            "kinematic_error_arcmin",
            "transmission_error_arcmin",
            "ripple_percent",
        )
        lines.append("strongest orders per input turn, amplitude zero to peak:")
        lines.append(
            table(
                [
                    (f"{line['order']:.6g}", *(line[key] for key in columns))
                    for line in result["orders"][:_SHOWN_ORDERS]
                ],
                header=(
                    "order",
                    "output error, no load [arcmin]",
                    "at rated torque [arcmin]",
                    "output torque ripple [% of rated torque]",
                ),
            )
        )
    lines += [*_rigid_generator(result), *turn_lines(result)]
    error = result["validity"].get("kinematic_error", "none")
    if error not in ("none", "given") and any(key in result for key in TURN_KEYS):
        lines.append(f"kinematic error (determines accuracy and ripple): {error}")
    rubs = result["validity"].get("hysteresis", "none")
    told = "hysteresis_loss_arcmin" in result["missing"]
    if rubs.startswith("none: ") and not told and set(keys) & set(LOOP_KEYS):
        lines.append(f"torque loop: {rubs.removeprefix('none: ')}")
    friction = result["validity"].get("friction", "none")
    if friction != "none" and any(key in result for key in LOSS_KEYS):
        speed = result["validity"]["running_speed_rpm"]
        lines.append(
            "losses are stated at the input, the back-driving torque at the output;"
            f" running torque and efficiency are at {speed:g} rpm, the efficiency at"
            f" rated torque; source of the friction: {friction}"
        )
    lines += [*result["validation_notes"], *doubts(result)]
    lines += _details(result)
    if "measured" in result:
        lines += _comparison(result["measured"])
    reasons: dict[str, list[str]] = {}
    for key, reason in result["missing"].items():
        reasons.setdefault(reason, []).append(words(key)[0])
    lines += [f"- {', '.join(names)}: {reason}" for reason, names in reasons.items()]
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join(lines)


def _rigid_generator(result: dict[str, Any]) -> list[str]:
    """State which figures are those of a drive without its wave-generator bearing."""
    keys = ("K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad", "lost_motion_arcmin")
    left_out = result["validity"].get("left_out") or ""
    if "wave_generator.bearing" not in left_out or not any(map(result.get, keys)):
        return []
    return [
        "K1, K2, K3 and lost motion: with a rigid wave generator instead of the ball"
        " bearing, whose clearance and balls give way; K1 of size-25-100-bought is 2.5"
        " times as large without it; the models ring and 2d contain the bearing"
    ]


def turn_lines(result: dict[str, Any]) -> list[str]:
    """State under which conditions the figures of the output turn are computed."""
    lines = []
    accuracies = ("transmission_accuracy_arcmin", "transmission_accuracy_rated_arcmin")
    if any(result.get(key) is not None for key in accuracies):
        lines.append(
            "transmission accuracy: peak to peak of the output error over one output"
            " turn at constant output torque, zero unless stated otherwise"
        )
    if any(result.get(key) for key in ("ripple_rms_percent", "ripple_pp_percent")):
        lines.append(
            "output torque ripple: at rated torque, with both shafts turning at a"
            " constant ratio; in an arm the output gives way, and swgjoint run computes"
            " the ripple that is left"
        )
    return lines


def _details(result: dict[str, Any]) -> list[str]:
    """Format the details of stiffness, ratcheting, running torque and fatigue."""
    lines = []
    if radial := result.get("radial_stiffness"):
        bent = radial["large_rotations"]
        lines.append(
            "radial stiffness: load at mid-face, boss clamped; for comparison [N/mm]:"
            f" open edge {radial['open_edge_N_mm']:.4g}, load distributed over the face"
            f" width {radial['spread_over_face_width_N_mm']:.4g}, large rotations under"
            f" {bent['force_N']:.3g} N {bent['outward_N_mm']:.4g} outward and"
            f" {bent['inward_N_mm']:.4g} inward, higher-order displacements"
            f" {radial['finer_displacements_N_mm']:.4g}, half the elements"
            f" {radial['half_the_elements_N_mm']:.4g}, smooth shell without teeth"
            f" {radial['smooth_shell_N_mm']:.4g}"
        )
    if path := result.get("ratcheting"):
        end = "" if path["passed"] else "; the search ended before a maximum"
        support = "on its bearing" if path["on_bearing"] else "without a bearing"
        lines.append(
            "ratcheting: the torque is largest after"
            f" {path['at_largest_pitches']:.3g} of a pitch, with"
            f" {path['at_largest_pairs']} teeth in contact; 2D model with a locked and"
            f" centred wave generator {support} (one that floats in its coupling holds"
            f" less){end}"
        )
    if slow := result.get("running"):
        lines.append(
            "running and starting torque: a lower bound, from Coulomb friction"
            f" ({slow['coefficient']:g}) at the teeth"
            f" ({100.0 * slow['teeth_share']:.3g} %) and between rim and race, and from"
            f" balls that roll under {slow['lobe_force_N']:.3g} N at each lobe (a"
            f" bearing maker's model); not included: {slow['left_out']}"
        )
    if losses := result.get("losses"):
        lines += _losses(losses)
    if efficiency := result.get("efficiency"):
        lines += _efficiency(efficiency)
    if fatigue := result.get("fatigue"):
        worst, middle = fatigue["worst_section"], fatigue["mid_face"]
        lines.append(
            f"fatigue safety factor at {fatigue['torque_Nm']:.4g} N·m, from nominal"
            " root stress times concentration factors: smallest at"
            f" z = {worst['z_mm']:.3g} mm (circumferential stress amplitude"
            f" {worst['normal_amplitude_MPa']:.3g} MPa); {middle['S']:.3g} at mid-face"
            f" ({middle['normal_amplitude_MPa']:.3g} MPa), there"
            f" {fatigue['S_without_factors_mid_face']:.3g} from the peak stress without"
            f" factors; shell theory {fatigue['shell_theory']['S']:.3g}"
        )
    return lines


def _losses(losses: dict[str, Any]) -> list[str]:
    """Format the friction of the parts over the load."""
    header = ("", *(f"{load:.4g} N·m" for load in losses["load_Nm"]))
    parts = losses["friction_Nm"]
    rows = [(key, *(1e3 * value for value in parts[key])) for key in parts]
    total = [sum(values) for values in zip(*parts.values(), strict=True)]
    share = (100.0 * value for value in losses["bending_share"])
    rows += [("total", *(1e3 * value for value in total)), ("bending [%]", *share)]
    return [
        f"friction at the input [mN·m] at {losses['speed_rpm']:g} rpm by output torque:"
        f" {losses['grease'].replace('_', ' ')} grease with a base oil of"
        f" {losses['base_oil_mm2_s']:.3g} mm²/s at {losses['temperature_C']:g} °C;"
        f" coefficient {losses['coefficient']:g} of teeth and of rim on race, loss"
        f" factor {losses['loss_factor']:g} of the bending steel",
        table(rows, header=header),
    ]


def _efficiency(found: dict[str, Any]) -> list[str]:
    """Format the efficiency over load, speed and temperature."""
    header = ("", *(f"{load:.4g} N·m" for load in found["load_Nm"]))
    rows = [
        (f"{celsius:g} °C, {speed:g} rpm", *values)
        for celsius, block in zip(
            found["temperature_C"], found["efficiency_percent"], strict=True
        )
        for speed, values in zip(found["speed_rpm"], block, strict=True)
    ]
    return [
        "efficiency [%] by temperature, input speed and output torque:",
        table(rows, header=header),
    ]


def _comparison(measured: dict[str, Any]) -> list[str]:
    """Format the comparison of the measured loop with the prediction."""
    low, high = measured["torque_range_Nm"]
    beyond = ", beyond the torque range of the map" if measured["beyond_range"] else ""
    rows = [
        (
            f"{row['segment']}, {row['from_Nm']:.4g} to {row['to_Nm']:.4g} N·m",
            row["K_measured_Nm_rad"],
            row["K_predicted_Nm_rad"],
            row["rms_arcmin"],
            row["largest_arcmin"],
        )
        for row in measured["segments"]
    ]
    lines = [
        f"measured loop {measured['file']}: {measured['samples']} samples, {low:.4g} to"
        f" {high:.4g} N·m{beyond}; drive {measured['history']}; residual rms"
        f" {measured['rms_arcmin']:.3g}, largest"
        f" {measured['largest_arcmin']:.3g} arcmin",
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
        (words(key)[0], *(measured[key][which] for which in ("measured", "predicted")))
        for key in ("hysteresis_loss_arcmin", "lost_motion_arcmin")
    ]
    lines.append(table(pairs, header=("[arcmin]", "measured", "predicted")))
    return [*lines, *(f"warning: {line}" for line in measured["warnings"])]


def _source(result: dict[str, Any]) -> str:
    """Level, validation and restrictions of the map, as text."""
    validity = result["validity"]
    text = f"level {validity['level']}"
    if result["validation"] is None and validity["level"] != "design":
        text += f"; {result['validation_reason'].partition(':')[0]}"
    if validity.get("beyond_range"):
        low, high = validity["torque_range_Nm"]
        text += (
            f"; loop extrapolated beyond the sampled range, {low:.4g} to {high:.4g} N·m"
        )
    if "stress_state" in validity:
        text += f"; {validity['stress_state']}"
    if validity.get("left_out"):
        text += f"; without {validity['left_out'].replace(' and ', ', ')}"
    if "ripple" in validity:
        text += f"; ripple {validity['ripple']}"
    if "manufacturing_errors" in validity:
        text += "; without manufacturing errors"
    return text
