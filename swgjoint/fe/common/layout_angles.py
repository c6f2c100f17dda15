"""Angles and torques of input and output in all three layouts, for 2D and 3D states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

from swgjoint.gear.kinematics import Layout, member_angles

if TYPE_CHECKING:
    from swgjoint.fe.plane.state import State
    from swgjoint.fe.solid.state import SolidState

AnyState = TypeVar("AnyState", "State", "SolidState")


class LayoutAngles(Generic[AnyState]):
    """Input and output of a drive one of whose members is fixed."""

    ratio: float
    """Signed gear ratio i [-]."""
    layout: Layout
    """Which member is fixed."""

    @property
    def circular_spline_is_output(self) -> bool:
        """Whether the circular spline is the output."""
        return self.layout != "circular_spline_fixed"

    def input_angle(self, state: AnyState) -> float:
        """Input angle theta [rad]."""
        if self.layout == "wave_generator_fixed":
            return state.rotation
        return state.wave_generator_angle

    def input_torque(self, state: AnyState) -> float:
        """External torque on the input [N·m]."""
        if self.layout == "wave_generator_fixed":
            return state.holding_torque
        return state.wave_generator_torque

    def output_angle(self, state: AnyState) -> float:
        """Output angle psi [rad]."""
        return (
            state.circular_spline_rotation
            if self.circular_spline_is_output
            else state.rotation
        )

    def ideal_angles(self, theta: float) -> tuple[float, float, float]:
        """Ideal angles of wave generator, flexspline and circular spline [rad].

        Args:
            theta: Input angle [rad].
        """
        return member_angles(self.layout, theta, theta / self.ratio)
