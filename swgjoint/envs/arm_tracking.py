"""An arm follows the path of a scene; torques or set-points are added to its loops."""

from __future__ import annotations

from swgjoint.envs.api import BatchEnv, SingleEnv
from swgjoint.envs.arm_core import ArmCore, ArmSettings


class ArmTrackingEnv(SingleEnv):
    """An arm with a drive in every joint follows the path of a scene.

    The scene is assembled as ``swgjoint run`` does: arm, drives, payload, path (joint
    or Cartesian), step, and its controller, PD on every motor's angle in the engine's
    step with its feed-forward, to which the action is added. Catalogue drives get the
    kinematic error that their catalogue states.

    Action, held over one control period; torque up to ``authority_of_rated`` times
    rated torque over ratio, or, with ``action="setpoint"``, a shift of the links'
    set-points of up to ``shift_arcmin``:

    =====  ====================================================  ====  =======
    index  meaning                                               unit  range
    =====  ====================================================  ====  =======
    0-5    added motor torque, of its authority, of every joint  1     -1 to 1
    =====  ====================================================  ====  =======

    Observation, for scene ``ur5e-circle``; the last two entries only with
    ``sensors={"link_encoder": True, "torque_sensor": True}``:

    =====  =====================================================  =====  =============
    index  meaning                                                unit   range
    =====  =====================================================  =====  =============
    0-5    motor angle, read, of every joint                      rad    -230 to 230
    6-11   motor speed, change of the reading, of every joint     rad/s  -240 to 240
    12-17  motor angle, ratio * reference - read, of every joint  rad    -1.6 to 1.6
    18-23  motor speed, ratio * reference - read, of every joint  rad/s  -15 to 15
    24-29  reference speed of the link of every joint             rad/s  -0.69 to 0.69
    30-35  known torque of the link of every joint                N·m    -30 to 30
    36-41  last action of every joint                             1      -1 to 1
    42-47  link angle, read, of every joint                       rad    -2.3 to 2.3
    48-53  output torque, read, of every joint                    N·m    -410 to 410
    =====  =====================================================  =====  =============

    Ranges of the tracking errors as in
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`.

    Reward of a step, with the distance d of the tool from its reference (linearised
    about it) and the mean square of the actions a:

        1/(1 + (d/error_scale)^2) - effort_weight mean(a^2)

    Start: at rest as the scene starts, the drives carrying weight and load.
    ``truncated`` after ``episode_s`` or the scene's duration. ``terminated`` when a
    limit is broken (``info["broken_limit"]``, see
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`): a link 0.3 rad beyond the
    range of the path, a motor 20 rad/s beyond twice the fastest speed of the path, a
    drive beyond its momentary peak torque or where it ratchets. ``info`` as there,
    with arrays over the joints, and ``tool_error_mm``.

    Args (all by keyword):
        scene: Name or path of a scene that starts at rest, or of an arm, which then
            sweeps its joints; ``ur5e-circle``.
        level: ``full`` or ``linear``.
        friction: Whether drives have the friction of their maps, whatever the scene
            says; True.
        kinematic_error_arcmin: As in ``JointTracking-v0``, whatever the scene says; the
            joints' phases differ.
        action: ``torque`` or ``setpoint``.
        authority_of_rated: 0.2.
        shift_arcmin: 10.
        episode_s: 2.
        sensors: As in ``JointTracking-v0``.
        randomise: Likewise, but ``load_inertia`` has no effect, the payload is the
            scene's; so at ``linear`` True draws nothing.
        error_scale_mm: Of the reward; 1.
        effort_weight: Of the reward; 0.1.

    Versions: v0, the first.
    """

    core_of = ArmCore
    settings_type = ArmSettings


class ArmTrackingVectorEnv(BatchEnv):
    """Many episodes of :class:`ArmTrackingEnv` on the threads of the engine."""

    single = ArmTrackingEnv
