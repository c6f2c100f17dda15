"""Heads and rows of the tables of the validation pages, from frozen results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from map_accuracy import BESIDE, BESIDE_ANGLES, MANY_ANGLES, MANY_PARTS

from swgjoint.units import arcsec

Row = dict[str, Any]


def span(low: float, high: float) -> str:
    """Both ends of a bracket, with two digits."""
    return f"{digits(low)} to {digits(high)}"


def digits(value: float) -> str:
    """Two significant digits, but no fewer than the whole number."""
    return f"{value:.0f}" if abs(value) >= 10.0 else f"{value:#.2g}"


def losses(rows: list[Row]) -> list[list[str]]:
    """Running torque, efficiency and starting torque of the catalogue, by size."""
    sizes = [row for row in rows if row["quantity"] == "no-load running torque"]
    starts = [row for row in rows if row["quantity"] == "starting torque"]
    shares = [row for row in rows if row["unit"] == "%"]
    wide = "model, run in to flooded, 30 to 300 mm²/s"
    near = "model, flooded, greases of the maker"
    table = [["size", *(str(row["size"]) for row in sizes)]]
    for name, found in (
        ("no-load running torque, catalogue [mN·m]", sizes),
        ("efficiency at rated torque, catalogue [%]", shares),
    ):
        table += [
            [name, *(f"{row['source_value']:.0f}" for row in found)],
            [wide, *(span(row["low"], row["high"]) for row in found)],
            [near, *(span(*row["maker_greases"]) for row in found)],
        ]
    stated = [f"{row['source_value']:.0f}" for row in starts]
    table.append(["starting torque, catalogue [mN·m]", *stated])
    table.append(["model", *(span(row["low"], row["high"]) for row in starts)])
    return table


def wave_generators(rows: list[Row]) -> list[list[str]]:
    """Stresses [MPa] of four wave generators, Table 5.6 of the thesis."""
    keys = "source_value", "ours_tenth", "ours", "converged_tenth", "converged"
    head = ["wave generator, stress [MPa]", "thesis", "ours, T/10", "ours, T"]
    table = [[*head, "ours, T/10, fine", "ours, T, fine"]]
    for row in rows:
        name = f"{row['case'].removeprefix('table-5.6 ')}, {row['quantity']}"
        table.append(
            [name.removesuffix(" stress"), *(f"{row[key]:.1f}" for key in keys)]
        )
    return table


def resonance(rows: list[Row]) -> list[list[str]]:
    """Frequencies of the linear level and of its closed form."""
    table = [["CSG-25-100 at level `linear`", "closed form [Hz]", "chirp [Hz]"]]
    table[0].append("difference [%]")
    for row in rows:
        if row["case"] == "CSG-25-100, linear":
            found, exact = row["ours"], row["source_value"]
            cells = f"{exact:.2f}", f"{found:.2f}", f"{100 * (found / exact - 1):.2f}"
            table.append([row["quantity"], *cells])
    return table


def back_driving(results: Sequence[Row]) -> list[list[str]]:
    """Back-driving torque of catalogue drives of ratio 100, by size."""
    key = "back_driving_torque_Nm"
    sizes = [one["design"].split("-")[1] for one in results]
    return [
        ["CSG, ratio 100, size", *sizes],
        [
            "back-driving torque, predicted [N·m]",
            *(f"{one[key]:.2f}" for one in results),
        ],
        [
            "back-driving torque, stated [N·m]",
            *(f"{one['stated'][key]:.2f}" for one in results),
        ],
    ]


def efficiencies(results: Sequence[Row]) -> list[list[str]]:
    """Efficiency [%] at 2000 rpm by torque up to the rated one, and temperature."""
    flooded, run_in = results
    loads = [f"{load:.4g}" for load in flooded["efficiency"]["load_Nm"]]
    table = [["output torque [N·m]", *loads[:-1], f"{loads[-1]} (rated)"]]
    for result, grease, temperature in (
        (flooded, "flooded", 0.0),
        (flooded, "flooded", 20.0),
        (flooded, "flooded", 40.0),
        (run_in, "run in", 20.0),
    ):
        found = result["efficiency"]
        k = found["temperature_C"].index(temperature)
        row = found["efficiency_percent"][k][found["speed_rpm"].index(2000.0)]
        table.append([f"{grease}, {temperature:.0f} °C", *map(digits, row)])
    share = flooded["losses"]["bending_share"][1:]
    name = "share of bending in the losses, flooded, 20 °C [%]"
    return [*table, [name, *(f"{100.0 * one:.2f}" for one in share)]]


def radial_stiffness(results: Sequence[Row]) -> list[list[str]]:
    """Radial stiffness [N/mm] of a cup by mesh and load."""
    (result,) = results
    found = result["radial_stiffness"]
    large = found["large_rotations"]
    values = {
        "loads at mid-face, half of the elements per direction": "half_the_elements",
        "loads at the open edge": "open_edge",
        "loads spread over the face width": "spread_over_face_width",
        "smooth cup in closed form": "smooth_shell",
    }
    rows = {name: found[f"{key}_N_mm"] for name, key in values.items()}
    rows = {
        "loads at mid-face, mesh of the thesis": result["radial_stiffness_N_mm"],
        **rows,
        "pulled apart by 0.4 mm with large rotations": large["outward_N_mm"],
        "pressed together by 0.4 mm with large rotations": large["inward_N_mm"],
    }
    return [
        ["case", "radial stiffness [N/mm]"],
        *([name, f"{value:.1f}"] for name, value in rows.items()),
    ]


def kinematic_errors(results: Sequence[Row]) -> list[list[str]]:
    """Peak to peak of the kinematic error [µrad] by wave generator and torque."""

    def cell(result: Row) -> str:
        error = result["per_step"]["output_error_arcsec"]
        return f"{1e6 * arcsec * (max(error) - min(error)):.2f}"

    cells = [cell(one) for one in results]
    return [
        ["wave generator", "unloaded", "20 N·m"],
        ["elliptical", *cells[:2]],
        ["simplified", *cells[2:]],
    ]


def of_rows(
    table: Callable[[list[Row]], list[list[str]]],
) -> Callable[[Sequence[Row]], list[list[str]]]:
    """A table of the rows of a single study."""
    return lambda results: table(results[0]["rows"])


def tooth_profiles(rows: list[Row]) -> list[list[str]]:
    """Von Mises stress [MPa] with the tooth profiles of the thesis."""
    names = {
        "table-6.7 initial": "QCA profile, initial",
        "table-6.7 improved": "QCA profile, improved",
        "table-6.11 initial": "DCA profile, initial",
        "table-6.11 improved": "DCA profile, improved",
        "table-6.12 involute": "involute profile",
    }
    keys = "source_value", "ours_tenth", "ours", "converged_tenth", "converged"
    head = ["tooth profile", "thesis", "ours, T/10", "ours, T"]
    stress = {row["case"]: row for row in rows if row["kind"] == "von_mises"}
    return [
        [*head, "ours, T/10, fine", "ours, T, fine"],
        *(
            [name, *(f"{stress[case][key]:.1f}" for key in keys)]
            for case, name in names.items()
        ),
    ]


def controllers(rows: list[Row]) -> list[list[str]]:
    """Mean and standard deviation of each controller over its specimens."""
    units = {
        "tracking_rms": "tracking error, rms [arcmin]",
        "tracking_peak": "tracking error, peak [arcmin]",
        "positioning_pp": "one-way error, pp [arcmin]",
        "ripple_rms": "torque ripple, rms [% of rated]",
        "two_per_turn": "ripple at 2 per input turn [N·m]",
        "effort_rms": "motor torque, rms [N·m]",
    }
    names = {
        "PD": ("PD on the motor", ""),
        "+ feed-forward": ("+ feed-forward", "tracking_rms"),
        "+ flexible joint": ("+ plan of a flexible joint", "tracking_rms"),
        "+ kinematic error": ("+ table of the kinematic error", "positioning_pp"),
        "+ learning": ("+ learning", "ripple_rms"),
        "MPC": ("predictive, link encoder", "tracking_peak"),
        "flexible joint, learning": ("learning without the table", "two_per_turn"),
    }
    table = [["controller", *units.values()]]
    for name, (label, target) in names.items():
        cells = [label]
        for key in units:
            (row,) = (
                row
                for row in rows
                if row["case"] == f"CSG-25-100, {name}" and row["quantity"] == key
            )
            cell = f"{row['ours']:.2f} ± {row['spread']:.2f}"
            if key == "effort_rms":
                cell = f"{row['ours']:.2f}"
            cells.append(f"**{cell}**" if key == target else cell)
        table.append(cells)
    return table


MANY_SOLVES = len(MANY_PARTS) * MANY_ANGLES + 2 * len(BESIDE) * BESIDE_ANGLES
"""Number of other solves with which the record of a map is compared."""


def map_accuracy(results: Sequence[Row]) -> list[list[str]]:
    """Differences of maps from unseen solves, and those that their records state."""
    table = [["design", "wave generator", "angles, solves", "CPU s"]]
    for name in ("input torque", "output error"):
        largest = f"largest of {MANY_SOLVES:,} [%]"
        table[0] += [f"{name}: largest, rms [%]", largest, "record [%]"]
    for result in results:
        own = f"{result['teeth']} teeth, of the test"
        name = own if result["design"].startswith("own") else f"`{result['design']}`"
        cells = [name, result["wave_generator"].replace("_", " ")]
        cells.append(f"{result['angles']}, {result['solves']}")
        cells.append(f"{result['cpu_s']:.0f}")
        for key in ("input_torque", "output_error"):
            found = result[key]
            largest = max(found["largest_of_many"], found["largest_beside_record"])
            cells.append(f"{100.0 * found['largest']:.1f}, {100.0 * found['rms']:.1f}")
            cells += [f"{100.0 * value:.1f}" for value in (largest, found["record"])]
        table.append(cells)
    return table


def fatigue(rows: list[Row]) -> list[list[str]]:
    """Fatigue safety factor of a cup by theory and model at four torques."""
    names = {
        "S, shell theory": "shell theory of the article",
        "S, four forces, mid-face": "finite elements, four forces, mid-face",
        "S, meshing, ellipse, mid-face": "meshing on a straight ellipse, mid-face",
        "S, meshing, ellipse, worst section": "the same, worst section",
        "S, meshing, crowned, worst section": "meshing on a crowned and sloped ellipse,"
        " worst section (at mid-face)",
        "S, meshing, ellipse, without factors": "straight ellipse, mid-face, peak"
        " stress in the fillet without concentration factor",
    }
    torques = (20.0, 60.0, 100.0, 140.0)
    head = "safety factor at a torque of [N·m]"
    table = [[head, *(f"{torque:.0f}" for torque in torques)]]
    found = {
        (row["quantity"], row["torque_Nm"]): row["ours"]
        for row in rows
        if row["part"] == "fatigue" and "torque_Nm" in row
    }
    for quantity, name in names.items():
        table.append([name, *(f"{found[quantity, t]:.2f}" for t in torques)])
    return table


def experiments(results: Sequence[Row]) -> list[list[str]]:
    """Stiffness at ratio 50 over that at ratio 100 after one change."""
    names = {
        "no change": "none",
        "rim 0.0125 d at both ratios": "rim 0.0125 d at both ratios, as before the"
        " rules",
        "bearing clearance 23 um": "bearing clearance 23 µm instead of 14.5 µm",
        "groove 0.53": "groove 0.53 instead of 0.52 of the ball diameter",
        "teeth 1 % thinner": "flexspline teeth 1 % thinner: a play that follows the"
        " module",
        "play of the coupling": "play of the coupling, 20 arcsec at ratio 50 and 10 at"
        " ratio 100",
        "coupling of 200 N·m/rad": "elastic coupling of 200 N·m/rad at the input",
        "flank, thinner teeth and coupling together": "flank of 28 deg, 1 % thinner"
        " teeth and elastic coupling together",
    }
    (result,) = results
    head = ["change (size 25, short cup, 20 deg)", "K1(50)/K1(100)", "K2(50)/K2(100)"]
    table = [[*head, "K3(50)/K3(100)"]]
    for one in result["experiments"]["rows"]:
        name = one["experiment"]
        cells = [f"{value:.2f}" for value in one["effect"]]
        table.append([names.get(name, name), *cells])
    return table


def coning(results: Sequence[Row]) -> list[list[str]]:
    """Radial motion of the bore at the major axis, at both ends of the face [mm]."""
    straight, crowned = (
        {state["state"]: state["major"] for state in result["coning_mm"]}
        for result in results
    )
    rows = {
        "straight, without teeth": straight["wave_generator"],
        "straight, with teeth at 20 N·m": straight["torque"],
        "with crowning and slope, without teeth": crowned["wave_generator"],
    }
    return [
        ["wave generator, load", "open edge [mm]", "closed edge [mm]"],
        *(
            [name, *(f"{at[edge]:.3f}" for edge in ("open_edge", "closed_edge"))]
            for name, at in rows.items()
        ),
    ]


def bearing_in_plane(results: Sequence[Row]) -> list[list[str]]:
    """Stiffness of 2D elements and of thin rings on the same bearing."""
    keys = "K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad"
    table = [["model", *(f"{key[:2]} [N·m/rad]" for key in keys)]]
    for name, result in zip(("2D finite elements", "thin rings"), results, strict=True):
        cells = [f"{result[key]:.2e}".replace("e+0", "e") for key in keys]
        table.append([name, *cells])
    return table
