"""The design file: what it holds, what it refuses, how it is told apart."""

from __future__ import annotations

import math
import re
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import names, naming

from swgjoint.errors import DesignError
from swgjoint.gear.catalogue import SIZE, catalogue_rows, nearest_row, ratings_of, table
from swgjoint.gear.design.design import Design
from swgjoint.models_path import bundled_names, models_path


@pytest.fixture(scope="module")
def reference() -> Design:
    return Design.preset("reference-2d")


def faults(design: Design, changes: dict) -> list[str]:
    """Lines with which changes are refused, without the common beginning."""
    with pytest.raises(DesignError) as caught:
        design.with_changes(changes)
    lines = str(caught.value).splitlines()
    where = "design 'reference-2d' with changes: "
    assert all(line.startswith(where) for line in lines)
    return [line.removeprefix(where) for line in lines]


def test_reference_is_table_4_1(reference):
    """The reference holds the values of thesis Table 4.1 in the file's units."""
    assert (
        reference.drive.teeth_flexspline,
        reference.drive.teeth_circular_spline,
    ) == (
        120,
        122,
    )
    assert (reference.flexspline.rim_mm, reference.circular_spline.rim_mm) == (1, 2)
    for member in (reference.flexspline, reference.circular_spline):
        p = member.profile
        arcs = (p.tip_radius_mm, p.addendum_radius_mm, p.straight_mm)
        assert (*arcs, p.dedendum_radius_mm, p.root_radius_mm) == (0.3, 1, 0.2, 2, 0.3)
        assert (p.kind, p.straight_split) == ("qca", 0.5)
        assert (member.addendum_coefficient, member.dedendum_coefficient) == (0.6, 0.8)
        assert (member.pressure_angle_deg, member.thickness_coefficient) == (20, 1)
    generator = reference.wave_generator
    assert (generator.kind, generator.minor_axis_coefficient) == ("elliptical", 1.0)


def test_figures_in_si(reference):
    """Properties are SI: ratio -60, pitch diameter 0.12 m, bore radius 58.2 mm."""
    assert reference.ratio == -60
    assert reference.pitch_diameter == pytest.approx(0.12, rel=1e-15)
    # thesis eq. (3.1): 60 - 0.8 - 1 mm
    assert reference.flexspline_inner_radius == pytest.approx(0.0582, rel=1e-14)
    assert (reference.lobes, reference.tooth_difference) == (2, 2)
    steel = reference.material_of("flexspline")
    assert (steel.youngs_modulus, steel.poisson_ratio) == (210e9, 0.29)
    assert steel.shear_modulus == pytest.approx(210e9 / 2.58, rel=1e-15)


def test_simplified_variant_differs_in_the_wave_generator_only(reference):
    """The second bundled design is the first with another wave generator."""
    other = Design.preset("reference-2d-simplified")
    changed = reference.with_changes(
        wave_generator={"kind": "simplified", "minor_axis_coefficient": 0.97}
    )
    assert other.content_hash() == changed.content_hash()
    assert other.content_hash() != reference.content_hash()


@pytest.mark.parametrize("name", bundled_names("drives", ".toml"))
def test_bundled_designs_load_by_name_and_path(name):
    """Every bundled design loads by name, with suffix and by path, and names itself."""
    design = Design.load(name)
    assert design.drive.name == name
    assert design.drive.source
    assert Design.load(f"{name}.toml") == design
    assert Design.load(models_path() / "drives" / f"{name}.toml") == design


def test_text_round_trip(reference):
    """The text of a design reads back to the same design, awkward texts included."""
    named = reference.with_changes(drive__name='a "b" \\ \t\n µ', drive__source="§")
    again = Design.from_toml(named.to_toml())
    assert again.model_dump() == named.model_dump()
    tomllib.loads(named.to_toml())


def test_whole_numbers_are_numbers(reference):
    """TOML's 1 is accepted for 1.0 and is the same design."""
    text = reference.to_toml().replace("module_mm = 1.0", "module_mm = 1")
    assert "module_mm = 1\n" in text
    assert Design.from_toml(text).content_hash() == reference.content_hash()


@pytest.mark.parametrize(
    ("key", "zero"),
    [
        ("tolerances.random_pitch_um", 0.0),
        ("micro_geometry.wave_generator_slope_um", 0.0),
        ("friction.tooth_coefficient", 0.0),
    ],
)
def test_the_sign_of_zero_is_no_content(reference, key, zero):
    """A design with -0.0 has the hash, and so the cached results, of one with 0.0."""
    negative = reference.with_changes({key: -zero})
    assert negative.content_hash() == reference.with_changes({key: zero}).content_hash()


def test_the_sign_of_zero_in_a_list_is_no_content(reference):
    """The same for the angles of a tabulated wave generator, of which one may be 0."""
    tables = [
        {
            "kind": "table",
            "angle_deg": [zero, *range(45, 360, 45)],
            "radius_mm": [59.2, 58.2, 57.2, 58.2] * 2,
        }
        for zero in (0.0, -0.0)
    ]
    plain, negative = (
        reference.with_changes({"wave_generator": table}).content_hash()
        for table in tables
    )
    assert plain == negative


def test_hash_tells_content_apart(reference):
    """The hash ignores name and source and sees every other key."""
    assert (
        reference.with_changes(drive__name="x", drive__source="y").content_hash()
        == reference.content_hash()
    )
    changes = {
        "flexspline.rim_mm": 1.0000000001,
        "circular_spline.profile.root_radius_mm": 0.31,
        "material.circular_spline.youngs_modulus_GPa": 200,
        "tolerances.random_pitch_um": 1,
        "joint.damping_ratio": 0.03,
        "mesh.refinement": 2,
        "drive.layout": "flexspline_fixed",
        "cup": {"length_mm": 40, "fillet_mm": 2, "bore_radius_mm": 20},
    }
    hashes = {reference.with_changes({k: v}).content_hash() for k, v in changes.items()}
    assert len(hashes | {reference.content_hash()}) == len(changes) + 1


def test_results_of_before_hold_in_plane_stress(reference):
    """Plane stress has the hash it had before there was a choice; others differ."""
    kinds = ("auto", "plane_stress", "plane_strain")
    hashes = {
        reference.with_changes(mesh__stress_state=kind).content_hash() for kind in kinds
    }
    assert len(hashes) == 3
    before = "6ab1c70f85d586e466101f4df9b1c34f9f4834a3d1f757b06f3e64552001c2bf"
    assert Design.preset("reference-3d-modified").content_hash() == before


def test_changes_leave_the_original(reference):
    """A changed copy is another object; None takes a key back to its default."""
    thick = reference.with_changes(flexspline__rim_mm=2.5)
    assert (thick.flexspline.rim_mm, reference.flexspline.rim_mm) == (2.5, 1.0)
    assert thick.with_changes({"flexspline.rim_mm": 1.0}) == reference
    assert thick.with_changes({"ratings": None}).ratings.rated_torque_Nm is None
    with pytest.raises(ValueError, match="frozen"):
        reference.drive.module_mm = 2.0


def test_members_may_differ_in_material(reference):
    """A member's own key overrides the common one and leaves the others."""
    design = reference.with_changes({"material.flexspline.youngs_modulus_GPa": 70})
    assert design.material_of("flexspline").youngs_modulus == 70e9
    assert design.material_of("flexspline").poisson_ratio == 0.29
    assert design.material_of("circular_spline").youngs_modulus == 210e9


def test_all_faults_at_once(reference):
    """Every fault has its line: path, value, unit, what is accepted."""
    lines = faults(
        reference,
        {
            "flexspline.rim_mm": -1.0,
            "flexspline.rim": 1,
            "wave_generator.kind": "eliptical",
            "drive.module_mm": "1",
            "drive.teeth_flexspline": 120.5,
            "circular_spline.profile.tip_radius_mm": -1,
            "drive.face_width_mm": True,
            "material.poisson_ratio": 0.5,
            "mesh.refinement": 0,
            "tolerances.seed": None,
            "joint.damping_ratio": math.inf,
        },
    )
    wanted = [
        ("flexspline.rim_mm", "-1 mm", "> 0 mm", "<= 10000 mm"),
        (
            "flexspline.rim",
            "rim_mm",
            "profile",
            "pressure_angle_deg",
            "addendum_coefficient",
            "dedendum_coefficient",
            "thickness_coefficient",
        ),
        (
            "wave_generator.kind",
            "'eliptical'",
            "'elliptical'",
            "'simplified'",
            "'parabolic'",
            "'asymmetric_parabolic'",
            "'four_roller'",
            "'cosine'",
            "'table'",
        ),
        ("drive.module_mm", "'1'", "> 0 mm", "<= 50 mm"),
        ("drive.teeth_flexspline", "120.5", "integer", ">= 40", "<= 400"),
        ("circular_spline.profile.tip_radius_mm", "-1 mm", "> 0 mm", "<= 10000 mm"),
        ("drive.face_width_mm", "true", "> 0 mm", "<= 10000 mm"),
        ("material.poisson_ratio", "0.5", ">= 0", "< 0.5"),
        ("mesh.refinement", "0", ">= 0.5", "<= 16"),
        ("joint.damping_ratio", "inf", "finite", ">= 0", "<= 2"),
    ]
    assert len(lines) == len(wanted)
    for parts in wanted:
        assert any(names(line, *parts) for line in lines), parts


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"drive.teeth_circular_spline": 120},
            ("drive.teeth_circular_spline", "120", "flexspline"),
        ),
        (
            {"drive.teeth_circular_spline": 121},
            ("drive.teeth_circular_spline", "1", "2", "3", "12"),
        ),
        (
            {"drive.teeth_circular_spline": 123},
            ("wave_generator.kind", "'elliptical'", "3", "cosine", "table"),
        ),
        ({"flexspline.rim_mm": 59.2}, ("flexspline.rim_mm", "< 59.2 mm")),
        (
            {"flexspline.profile.straight_mm": 1e-9},
            ("flexspline.profile.straight_mm", "1e-09 mm", "0", "1e-06 mm"),
        ),
        (
            {"flexspline.profile.kind": "dca"},
            (
                "flexspline.profile.tip_radius_mm",
                "addendum_radius_mm",
                "dedendum_radius_mm",
                "kind",
                "straight_split",
            ),
        ),
        (
            {"wave_generator.kind": "four_roller"},
            ("wave_generator.aperture_deg", "> 0 deg", "< 45 deg"),
        ),
        (
            {"wave_generator": {"minor_axis_coefficient": 1}},
            (
                "wave_generator.kind",
                "'elliptical'",
                "'simplified'",
                "'parabolic'",
                "'asymmetric_parabolic'",
                "'four_roller'",
                "'cosine'",
                "'table'",
            ),
        ),
        ({"wave_generator": 4}, ("wave_generator", "4", "table")),
        ({"flexspline": None}, ("flexspline", "table")),
        (
            {"ratings.T1_Nm": 9, "ratings.T2_Nm": 5},
            ("ratings.T2_Nm", "5 N·m", "T1_Nm", "9 N·m"),
        ),
        (
            {"ratings.repeated_peak_Nm": 5},
            ("ratings.repeated_peak_Nm", "5 N·m", "rated_torque_Nm", "20 N·m"),
        ),
        (
            {"cup": {"length_mm": 40, "fillet_mm": 2, "bore_radius_mm": 58.2}},
            ("cup.bore_radius_mm", "inner radius", "58.2 mm"),
        ),
        (
            {"cup": {"length_mm": 10, "fillet_mm": 2, "bore_radius_mm": 20}},
            ("cup.length_mm", "face width", "10 mm"),
        ),
        (
            {"wave_generator": {"kind": "asymmetric_parabolic"}},
            ("wave_generator.kind", "'asymmetric_parabolic'", "left", "right"),
        ),
        (
            {
                "wave_generator": {
                    "kind": "table",
                    "angle_deg": [0, 45, 90, 135, 180, 225, 270, 360],
                    "radius_mm": [58] * 8,
                }
            },
            ("wave_generator.angle_deg", "360 deg"),
        ),
        (
            {
                "flexspline.profile": {"kind": "conjugate"},
                "circular_spline.profile": {"kind": "conjugate"},
            },
            ("circular_spline.profile.kind", "'conjugate'", "one"),
        ),
    ],
)
def test_faults_between_keys(reference, changes, message):
    """Keys that do not go together are refused in one line that says what would."""
    assert any(names(line, *message) for line in faults(reference, changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"flexspline.profile": {"kind": "dca", "addendum_radius_mm": 1,
                                "dedendum_radius_mm": 0.6}},
        {"circular_spline.profile": {"kind": "conjugate"}},
        {"wave_generator": {"kind": "four_roller", "aperture_deg": 20,
                            "roller_radius_mm": 20}},
        {"wave_generator": {"kind": "parabolic", "parabola_coefficient_per_mm": 0.01,
                            "parabola_length_coefficient": 0.5,
                            "connector_radius_mm": 10}},
        {"wave_generator": {"kind": "cosine"}, "drive.teeth_circular_spline": 123},
        {"wave_generator.bearing": {"balls": 23, "ball_diameter_mm": 6,
                                    "race_thickness_mm": 1}},
        {"drive.teeth_flexspline": 121, "drive.teeth_circular_spline": 123},
    ],
)  # fmt: skip
def test_every_kind_is_declared(reference, changes):
    """Kinds that the geometry may not build yet are valid in the file."""
    assert reference.with_changes(changes).content_hash() != reference.content_hash()


def test_files_that_are_no_designs(tmp_path):
    """Syntax errors, other encodings, folders and missing files give one line."""
    bad = tmp_path / "bad.toml"
    for content, message in (
        (b"[drive\n", ("TOML", "line 1", "column 7")),
        (b"\xff\xfe", ("UTF-8", "byte 0")),
        (b"x = " + b"[" * 5000, ("TOML",)),
        (b"#" * 3_000_000, ("3000000 bytes", "2000000")),
    ):
        bad.write_bytes(content)
        with pytest.raises(DesignError, match=naming(str(bad), *message)) as caught:
            Design.load(bad)
        assert "\n" not in str(caught.value)
    for reference in (tmp_path, tmp_path / "none.toml", "reference-2e", "a\0b", ""):
        with pytest.raises(DesignError) as caught:
            Design.load(reference)
        assert "\n" not in str(caught.value)
    nearest = _refusal("reference-2e")
    assert names(nearest, "'reference-2e'", "size-NN-RRR", "models/drives")
    assert len(re.findall(r"reference-2d(?!\w|-)", nearest)) == 2  # and among all
    with pytest.raises(
        DesignError, match=naming("'none'", "models/drives", "reference-2d")
    ):
        Design.preset("none")


def _refusal(reference: str) -> str:
    with pytest.raises(DesignError) as caught:
        Design.load(reference)
    return str(caught.value)


_values = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.integers(), max_size=2),
    st.dictionaries(
        st.sampled_from(["kind", "rim_mm", "x"]), st.integers(), max_size=2
    ),
)
_KEYS = [
    f"{table}.{key}"
    for table, fields in Design.preset("reference-2d").model_dump().items()
    for key in (fields or {"length_mm": 0})
]


any_changes = given(
    changes=st.dictionaries(st.sampled_from(_KEYS), _values, max_size=4)
)


@settings(max_examples=80, deadline=None, derandomize=True)
@any_changes
def test_any_value_is_accepted_or_refused_in_lines(changes):
    """Whatever a file holds: a design, or lines that name the keys; no traceback."""
    assert_accepted_or_refused(changes)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@any_changes
def test_many_values_are_accepted_or_refused_in_lines(changes):
    """The same of more of them, others in every run."""
    assert_accepted_or_refused(changes)


def test_text_that_no_file_can_hold_is_refused(reference):
    """A control character, as in a file."""
    with pytest.raises(DesignError, match=r"drive\.name = .*: a control character"):
        reference.with_changes(drive__name="\x1f")


def assert_accepted_or_refused(changes):
    """A whole design, or lines with a key each."""
    design = Design.preset("reference-2d")
    try:
        changed = design.with_changes(changes)
    except DesignError as exc:
        assert all(": " in line for line in str(exc).splitlines())
    else:
        assert math.isfinite(changed.flexspline_inner_radius)
        assert Design.from_toml(changed.to_toml()).content_hash() == (
            changed.content_hash()
        )


def test_ratings_of_the_reference(reference):
    """Rated 20 N·m is given; the rest is CSG-32-50 scaled by 20/99."""
    ratings = ratings_of(reference)
    assert ratings.rated_torque == 20
    assert ratings.repeated_peak == pytest.approx(281 * 20 / 99, rel=1e-14)
    assert ratings.momentary_peak == pytest.approx(497 * 20 / 99, rel=1e-14)
    assert (ratings.T1, ratings.T2) == pytest.approx((29 * 20 / 99, 108 * 20 / 99))
    assert "CSG-32-50" in ratings.source


def test_ratings_scale_with_the_cube_of_the_diameter(reference):
    """Without a rated torque, geometry scaled by 1.5 carries 1.5 cubed the torque."""
    small = reference.with_changes({"ratings": None, "drive.module_mm": 0.5})
    large = small.with_changes({"drive.module_mm": 0.75})
    a, b = ratings_of(small), ratings_of(large)
    # both lie between sizes, so the row differs; the same row gives the exact cube
    row = nearest_row(small.pitch_diameter, 60)
    factor = (small.pitch_diameter / row.pitch_diameter) ** 3
    assert a.rated_torque == pytest.approx(row.rated_torque * factor, rel=1e-14)
    assert 2 < b.rated_torque / a.rated_torque < 6


def test_a_catalogue_size_keeps_its_ratings(reference):
    """A design of the size and ratio of a row gets that row's torques."""
    row = next(r for r in catalogue_rows() if r.name == "CSG-25-80")
    design = reference.with_changes(
        {
            "ratings": None,
            "drive.teeth_flexspline": 160,
            "drive.teeth_circular_spline": 162,
            "drive.module_mm": 25 * SIZE * 1e3 / 160,
        }
    )
    ratings = ratings_of(design)
    assert ratings.rated_torque == pytest.approx(row.rated_torque, rel=1e-12)
    assert ratings.momentary_peak == pytest.approx(row.momentary_peak, rel=1e-12)
    assert (ratings.T1, ratings.T2) == pytest.approx((14, 48), rel=1e-12)


def test_where_no_row_fits_the_limits_are_shares_of_rated(reference):
    """A drive of five times the size has T1, T2 = 0.2 and 0.6 of rated, flagged."""
    ratings = ratings_of(reference.with_changes({"drive.module_mm": 5}))
    assert (ratings.T1, ratings.T2) == pytest.approx((4, 12))
    assert "no row fits" in ratings.source


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    given=st.dictionaries(
        st.sampled_from(
            [
                "rated_torque_Nm",
                "repeated_peak_Nm",
                "momentary_peak_Nm",
                "T1_Nm",
                "T2_Nm",
            ]
        ),
        st.floats(0.1, 1e4),
    )
)
def test_ratings_keep_their_order_and_the_given_values(given):
    """Given torques are kept, defaults give way: rated <= repeated <= momentary."""
    design = Design.preset("reference-2d")
    try:
        design = design.with_changes({"ratings": given})
    except DesignError:
        return
    r = ratings_of(design)
    assert r.rated_torque <= r.repeated_peak <= r.momentary_peak
    assert r.T1 < r.T2
    held = {
        "rated_torque_Nm": r.rated_torque,
        "repeated_peak_Nm": r.repeated_peak,
        "momentary_peak_Nm": r.momentary_peak,
        "T1_Nm": r.T1,
        "T2_Nm": r.T2,
    }
    assert {key: held[key] for key in given} == given


def test_catalogue_tables_are_sound():
    """Rising ratings and K1 < K2 < K3 in every row; T1 < T2."""
    assert len(catalogue_rows()) == 22
    for row in catalogue_rows():
        assert row.rated_torque < row.repeated_peak < row.momentary_peak
        assert row.momentary_peak < row.ratcheting_torque
        assert row.T1 < row.T2
    for line in table("stiffness"):
        k1, k2, k3 = (line[f"K{n}_1e4Nm_rad"] for n in (1, 2, 3))
        assert k1 < k2 < k3


@pytest.mark.parametrize("module", [0.001, 5e-4])
def test_a_module_in_metres_is_called_one(reference, module):
    """Before any other key: the value, the millimetres that it would be."""
    (line,) = faults(reference, {"drive.module_mm": module})
    assert names(
        line, "drive.module_mm", f"{module:g} mm", "metres", f"{1e3 * module:g} mm"
    )


def test_an_unknown_name_takes_one_short_line():
    """Suggestions and a list of names fit in less than 500 characters."""
    for name in [*(f"{one}.x" for one in bundled_names("drives", ".toml")), "x" * 120]:
        with pytest.raises(DesignError) as found:
            Design.load(name)
        assert len(f"swgjoint optimise: {found.value}") < 500
