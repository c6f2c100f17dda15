"""The design of a strain wave gear, as described by a design file."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import model_validator

from swgjoint.errors import DesignError, InputError
from swgjoint.faults import Fault, Section, validate
from swgjoint.gear import kinematics
from swgjoint.gear.design.family import family_design, family_member
from swgjoint.gear.design.losses import LossesSection
from swgjoint.gear.design.material import Material
from swgjoint.gear.design.sections import (
    Boss,
    CircularSplineMember,
    Coupling,
    Cup,
    DriveSection,
    FrictionSection,
    Housing,
    JointDampingSection,
    MaterialSection,
    Member,
    MeshSection,
    MicroGeometry,
    RatingsSection,
    TolerancesSection,
)
from swgjoint.gear.wave_generators.sections import WaveGenerator
from swgjoint.models_path import bundled_names, find
from swgjoint.toml_file import first_fault, parse_toml, read_toml
from swgjoint.toml_text import toml_text
from swgjoint.units import GPa, MPa, mm

MemberName = Literal["flexspline", "circular_spline"]


class Design(Section):
    """One drive, with one attribute per table of its design file.

    The attributes have the names and units of the keys in the file:
    ``design.flexspline.profile.tip_radius_mm`` is in millimetres. The properties of
    this class, in contrast, are in SI units. A design is immutable;
    :meth:`with_changes` returns a changed copy.
    """

    drive: DriveSection
    """Name, layout, tooth counts, module and face width."""
    material: MaterialSection = MaterialSection()
    """Material of both toothed members."""
    flexspline: Member
    """Teeth and rim of the flexspline."""
    circular_spline: CircularSplineMember
    """Teeth and rim of the circular spline."""
    wave_generator: WaveGenerator
    """Outline of the wave generator, by kind, and its bearing."""
    cup: Cup | None = None
    """Cup or hat behind the teeth; absent for a plain toothed ring."""
    boss: Boss | None = None
    """Spring between flexspline and shaft or frame; absent if rigid."""
    housing: Housing | None = None
    """Spring between circular spline and frame or shaft; absent if rigid."""
    coupling: Coupling | None = None
    """Spring between wave generator and shaft; absent if rigid."""
    micro_geometry: MicroGeometry = MicroGeometry()
    """Crowning and slope of wave generator and flanks."""
    tolerances: TolerancesSection = TolerancesSection()
    """Manufacturing errors."""
    friction: FrictionSection = FrictionSection()
    """Friction of the teeth."""
    losses: LossesSection | None = None
    """Lubricant, seals and loss factor; absent if losses at speed are not modelled."""
    ratings: RatingsSection = RatingsSection()
    """Catalogue torques at the output."""
    joint: JointDampingSection = JointDampingSection()
    """Damping of the drive in a robot joint."""
    mesh: MeshSection = MeshSection()
    """Mesh and stress state of the finite element models."""

    @model_validator(mode="after")
    def _members_fit(self) -> Self:
        """Check the keys of different tables against each other."""
        faults: list[tuple[str, str]] = []
        radius = self.flexspline_inner_radius / mm
        if radius <= 0:
            limit = radius + self.flexspline.rim_mm
            faults.append(
                (
                    "flexspline.rim_mm",
                    f"{self.flexspline.rim_mm:g} mm leaves no bore;"
                    f" accepted: < {limit:g} mm",
                )
            )
        if self.lobes == 3 and self.wave_generator.kind not in ("cosine", "table"):
            faults.append(
                (
                    "wave_generator.kind",
                    f"{self.wave_generator.kind!r} has two lobes, but a tooth"
                    f" difference of {self.tooth_difference} requires three; accepted:"
                    " cosine, table",
                )
            )
        if self.cup is not None and radius > 0:
            if self.cup.bore_radius_mm >= radius and self.cup.kind == "cup":
                faults.append(
                    (
                        "cup.bore_radius_mm",
                        f"{self.cup.bore_radius_mm:g} mm; accepted: below the inner"
                        f" radius of the flexspline, {radius:g} mm",
                    )
                )
            if self.cup.length_mm <= self.drive.face_width_mm:
                faults.append(
                    (
                        "cup.length_mm",
                        f"{self.cup.length_mm:g} mm; accepted: more than the face width"
                        f" {self.drive.face_width_mm:g} mm",
                    )
                )
        profiles = (self.flexspline.profile.kind, self.circular_spline.profile.kind)
        if profiles == ("conjugate", "conjugate"):
            faults.append(
                (
                    "circular_spline.profile.kind",
                    "'conjugate' cannot be the kind of both members; accepted: another"
                    " kind for one of them",
                )
            )
        if faults:
            raise Fault(*faults)
        return self

    # -- constructors -----------------------------------------------------------

    @classmethod
    def load(cls, reference: str | Path) -> Self:
        """Design from a file, given by its path or by the name of a bundled design.

        ``size-NN-RRR`` names a drive of the family, even if no file is bundled for it;
        see :mod:`swgjoint.gear.design.family`.

        Raises:
            DesignError: If there is no such design, or if its file has faults (one line
                per fault).

        >>> from swgjoint import Design
        >>> design = Design.load("reference-2d")
        >>> design.ratio
        -60.0
        """
        try:
            path = find(reference, "drives", ".toml", what="design")
        except InputError as exc:
            member = family_member(str(reference).removesuffix(".toml"))
            if member is None:
                raise DesignError(
                    f"{exc}; size-NN-RRR names a drive of the family"
                ) from None
            return cls.model_validate(family_design(*member))
        data = read_toml(path, what="design", error=DesignError)
        return validate(cls, data, where=str(path), error=DesignError)

    @classmethod
    def preset(cls, name: str) -> Self:
        """Bundled design of a name, regardless of files in the current folder.

        ``size-NN-RRR`` names a drive of the family, as in :meth:`load`.

        Raises:
            DesignError: If there is no bundled design of that name.
        """
        names = bundled_names("drives", ".toml")
        if name not in names:
            if (member := family_member(name)) is not None:
                return cls.model_validate(family_design(*member))
            raise DesignError(
                f"design {name!r} not in models/drives; available: {', '.join(names)}"
            )
        from swgjoint.models_path import models_path

        return cls.load(models_path() / "drives" / f"{name}.toml")

    @classmethod
    def from_toml(cls, text: str, where: str = "design") -> Self:
        """Design from the text of a design file.

        Args:
            text: Content of the file.
            where: Name of the source in messages.

        Raises:
            DesignError: If the text has faults (one line per fault).
        """
        data = parse_toml(text, where=where, error=DesignError)
        return validate(cls, data, where=where, error=DesignError)

    def with_changes(
        self, changes: Mapping[str, Any] | None = None, /, **dotted: Any
    ) -> Self:
        """Checked copy of the design with new values for some keys.

        Args:
            changes: Values by dotted key, e.g. ``{"flexspline.rim_mm": 0.5}``. If the
                value is a table, it replaces the whole table; ``None`` removes the key.
            **dotted: Values by key with two underscores instead of each dot, e.g.
                ``flexspline__rim_mm=0.5``.

        Raises:
            DesignError: If the changed design has faults (one line per fault).

        >>> from swgjoint import Design
        >>> stiff = Design.load("reference-2d").with_changes({"flexspline.rim_mm": 1.2})
        >>> stiff.flexspline.rim_mm
        1.2
        """
        data = self.model_dump(exclude_unset=True)
        merged = {
            **(changes or {}),
            **{k.replace("__", "."): v for k, v in dotted.items()},
        }
        where = f"design {self.drive.name!r} with changes"
        for key, value in merged.items():
            *tables, last = key.split(".")
            table = data
            for name in tables:
                table = table.setdefault(name, {})
                if not isinstance(table, dict):
                    raise DesignError(f"{where}: {key}: {name} is not a table")
            if value is None:
                table.pop(last, None)
            else:
                table[last] = value
        if (fault := first_fault(data)) is not None:
            # a file with these values could not be read
            raise DesignError(f"{where}: {fault}")
        return validate(type(self), data, where=where, error=DesignError)

    # -- text and identity ------------------------------------------------------

    def to_toml(self) -> str:
        """Text of a design file that describes the design, including default values."""
        return toml_text(self.model_dump(exclude_none=True))

    def content_hash(self) -> str:
        """SHA-256 of everything that affects results: all keys except name and source.

        Three keys are omitted if they have the values that applied before the keys were
        introduced, so that older cached results remain valid: an absent coupling, an
        absent table of losses and the stress state ``plane_stress``. A negative zero
        counts as zero.
        """
        data = _plain_zeros(self.model_dump(exclude={"drive": {"name", "source"}}))
        if self.coupling is None:
            del data["coupling"]
        if self.losses is None:
            del data["losses"]
        if self.mesh.stress_state == "plane_stress":
            del data["mesh"]["stress_state"]
        text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    # -- quantities in SI units -------------------------------------------------

    @property
    def ratio(self) -> float:
        """Signed ratio i [-]; see :func:`swgjoint.gear.kinematics.ratio`."""
        return kinematics.ratio(
            self.drive.layout,
            self.drive.teeth_flexspline,
            self.drive.teeth_circular_spline,
        )

    @property
    def periodicity(self) -> int:
        """Pitches per input turn; see :func:`swgjoint.gear.kinematics.periodicity`."""
        return kinematics.periodicity(
            self.drive.layout,
            self.drive.teeth_flexspline,
            self.drive.teeth_circular_spline,
        )

    @property
    def tooth_difference(self) -> int:
        """Teeth of the circular spline minus teeth of the flexspline."""
        return self.drive.teeth_circular_spline - self.drive.teeth_flexspline

    @property
    def lobes(self) -> int:
        """Lobes of the wave generator: two for an even tooth difference, else three."""
        return 2 if self.tooth_difference % 2 == 0 else 3

    @property
    def pitch_diameter(self) -> float:
        """Pitch diameter of the flexspline, module times number of teeth [m]."""
        return self.drive.module_mm * mm * self.drive.teeth_flexspline

    @property
    def flexspline_inner_radius(self) -> float:
        """Undeformed inner radius of the flexspline [m], thesis eq. (3.1)."""
        module = self.drive.module_mm
        return mm * (
            module * self.drive.teeth_flexspline / 2.0
            - self.flexspline.dedendum_coefficient * module
            - self.flexspline.rim_mm
        )

    def material_of(self, member: MemberName) -> Material:
        """Material of one member in SI units.

        Keys of ``[material.<member>]`` override those of ``[material]``.
        """
        base, override = self.material, getattr(self.material, member)

        def value(key: str, unit: float = 1.0) -> Any:
            chosen = getattr(override, key)
            chosen = getattr(base, key) if chosen is None else chosen
            return None if chosen is None else chosen * unit

        material = Material(
            youngs_modulus=value("youngs_modulus_GPa", GPa),
            poisson_ratio=value("poisson_ratio"),
            density=value("density_kg_m3"),
            fatigue_limit_bending=value("fatigue_limit_bending_MPa", MPa),
            fatigue_limit_torsion=value("fatigue_limit_torsion_MPa", MPa),
        )
        assert math.isfinite(material.youngs_modulus)
        return material


def _plain_zeros(value: Any) -> Any:
    """The value with 0.0 for every -0.0, also in tables and lists."""
    if isinstance(value, Mapping):
        return {key: _plain_zeros(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain_zeros(one) for one in value]
    return value + 0.0 if isinstance(value, float) else value


def check_design(design: object) -> None:
    """Reject an argument that is not a design, such as the name of one.

    Raises:
        InputError: If it is not a :class:`Design`.
    """
    if not isinstance(design, Design):
        raise InputError(
            f"design {str(design)[:40]!r} is a {type(design).__name__}; accepted: a"
            " Design, e.g. swgjoint.Design.load('reference-2d')"
        )
