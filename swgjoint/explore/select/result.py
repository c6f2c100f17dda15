"""Result of a selection of drives."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from swgjoint.explore.select.evaluation import (
    RESONANCE,
    TOOL,
    SimulatedSet,
    tool_shares,
)
from swgjoint.explore.select.loads import LimitCheck
from swgjoint.explore.select.options import DriveOption
from swgjoint.sim.figures.resonance import lowest_resonance
from swgjoint.sim.scene.scene import Scene

CAREFUL = 100
"""Number of simulated sets after which the predicted tool error is taken as exact, so
that many sets close to a limit end the search; a cheaper set may then be missed."""


@dataclass(frozen=True, kw_only=True)
class ScreenedDrive:
    """A drive at one joint before the simulation."""

    option: DriveOption
    """The drive."""
    checks: tuple[LimitCheck, ...]
    """Figures under the loads of the rigid arm."""
    excess: LimitCheck | None
    """Check for which the drive was dropped without simulation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveSelection:
    """Result of a selection."""

    name: str
    """Name of the scene."""
    spec: dict[str, float]
    """Limits by figure, with those of the ratings."""
    drives: dict[str, tuple[ScreenedDrive, ...]]
    """Drives by joint, in the order of the table."""
    simulated: tuple[SimulatedSet, ...]
    """Sets in the order of their simulation."""
    dropped: dict[str, dict[str, LimitCheck | str]]
    """Missed limit, or fault, of drives that were dropped in simulations, by joint and
    drive."""
    winner: SimulatedSet | None
    """Cheapest set that meets all limits; None if there is none."""
    scene: Scene | None
    """Scene with the drives of the winner."""
    failure: str
    """Joint and limit that leave no set; empty with a winner."""

    @property
    def misses_tool_error(self) -> bool:
        """Whether there is no set, and a simulated one misses a limit of the tool."""
        missed = (miss.check.key for one in self.simulated for miss in one.missed)
        return self.winner is None and any(key in TOOL for key in missed)

    @property
    def careful(self) -> bool:
        """Whether no set was dropped for a predicted tool error close to its limit."""
        return len(self.simulated) <= CAREFUL

    def to_json(self) -> dict[str, Any]:
        """Result under the keys of the JSON output."""
        chosen = {} if self.winner is None else self.winner.drives
        return {
            "scene": self.name,
            "spec": self.spec,
            "passed": self.winner is not None,
            "failure": self.failure or None,
            "careful": self.careful,
            "cost": None if self.winner is None else self.winner.cost,
            "drives": chosen or None,
            "joints": {
                name: [
                    {
                        "drive": one.option.drive,
                        "cost": float(one.option.cost),
                        "mass_kg": one.option.mass,
                        "ratings": one.option.map.ratings.source,
                        "selected": chosen.get(name) == one.option.drive,
                        "checks": [check.to_json() for check in one.checks],
                        "dropped": describe_drop(
                            one.excess or self.dropped[name].get(one.option.drive)
                        ),
                        "simulated": one.excess is None
                        and one.option.drive in self.dropped[name],
                    }
                    for one in drives
                ]
                for name, drives in self.drives.items()
            },
            "simulated": [one.to_json() for one in self.simulated],
        }


def describe_drop(why: LimitCheck | str | None) -> str | None:
    """Reason why a drive was dropped, as text; None for a drive that was not.

    Args:
        why: Missed limit, or fault of a simulation.
    """
    return why.text if isinstance(why, LimitCheck) else why


def describe_nearest(dropped: Mapping[str, LimitCheck | str | None]) -> str:
    """The drive that is nearest to its limit, as text; a fault if none has a limit.

    Args:
        dropped: Missed limit or fault by drive.
    """
    checks = {k: v for k, v in dropped.items() if isinstance(v, LimitCheck)}
    if not checks:
        drive, fault = next(iter(dropped.items()))
        return f"{drive}: {fault}"
    drive = min(checks, key=lambda drive: checks[drive].use)
    return f"the nearest is {drive} with {checks[drive].text}"


def explain_failure(
    dropped: Mapping[str, Mapping[str, LimitCheck | str]],
    remaining: Sequence[Collection[int]],
    simulated: Collection[SimulatedSet],
) -> str:
    """Joint and limit that leave no set after the simulations, as text.

    If a figure of the whole arm leaves none, the joint is that with the largest share.

    Args:
        dropped: Reasons why drives were dropped, by joint and drive.
        remaining: Drives that were not dropped, by joint.
        simulated: All simulated sets.
    """
    for (name, own), left in zip(dropped.items(), remaining, strict=True):
        if not left:
            why = describe_nearest(own)
            return f"{name}: no drive meets the spec in a simulation; {why}"
    runs = [one for one in simulated if one.missed]
    if not runs:
        reasons = [why for one in simulated for why in one.to_json()["reasons"]]
        return f"no set could be simulated; the first: {reasons[0]}"
    best = min(runs, key=lambda one: max(miss.check.use for miss in one.missed))
    miss = max(best.missed, key=lambda miss: miss.check.use)
    text = f"the nearest set has {miss.check.text}"
    if miss.joint is not None:
        return f"{miss.joint}: {text}"
    assert best.run is not None
    if miss.check.key == RESONANCE:
        resonance = lowest_resonance(best.run)
        assert resonance is not None
        shares, what = resonance[1], "elastic energy"
    else:
        shares, what = tool_shares(best.run), "mean square"
    name = max(shares, key=lambda name: shares[name])
    return (
        f"{name}: {text}, to which this joint with {best.drives[name]} contributes"
        f" most, {100.0 * shares[name]:.0f} % of the {what}"
    )
