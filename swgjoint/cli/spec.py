"""``swgjoint spec``: catalogue-style sheet of a design, map or catalogue drive."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.map_validity_text import doubts, mark_figure
from swgjoint.cli.shared.text import table
from swgjoint.files import Outputs, output_folder
from swgjoint.view.words import words

if TYPE_CHECKING:
    from swgjoint.maps.fit.overlay import Overlay
    from swgjoint.maps.sheet.spec_sheet import SpecSheet

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
        help="compute only what these keys need: ratings need no finite elements;"
        " stiffness, hysteresis loss and lost motion need few positions and no"
        " manufacturing errors; radial stiffness and fatigue safety factor need"
        " the 3D model; the ratcheting torque is computed only if it is named"
        " here",
    )
    parser.add_argument(
        "--measured",
        metavar="LOOP.csv",
        help="compare the prediction with a measured torque-torsion loop (input"
        " locked); columns torque_Nm and torsion_arcmin or torsion_rad",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write spec.json and spec.png there, with --measured also measured.png",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Find or build the map and measure it.

    Returns:
        What :func:`swgjoint.drives.spec_sheet.spec_sheet` says, and ``files``.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.drives.spec_sheet import measure_drive

    found = measure_drive(
        args.drive,
        model=args.model,
        only=[] if args.only is None else [k.strip() for k in args.only.split(",")],
        measured=args.measured,
        progress=args.progress,
    )
    wall = found.result.pop("wall_s")
    result = {**found.result, "files": [], "wall_s": wall}
    if folder is not None:
        _write(folder, result, found.sheet, found.overlay)
    return result


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
    """Values with units, the strongest orders, and missing values with reasons."""
    from swgjoint.gear.catalogue_stated import LOSS_KEYS
    from swgjoint.maps.sheet.spec_sheet import KEYS, TURN_KEYS

    keys = [key for key in KEYS if key in result and key != "orders"]
    stated = result.get("stated") or {}
    header = ("", "predicted", *(["stated"] if stated else []), "")
    rows = []
    for key in keys:
        name, unit = words(key)
        more = [stated.get(key)] if stated else []
        rows.append((name, mark_figure(result, key), *more, unit))
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
    """Background of the values computed with the 3D model."""
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
            " locked, 2D model"
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
    """The measured loop compared with the prediction."""
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
