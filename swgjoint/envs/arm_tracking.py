"""An arm tracks a path; actions add torques or shift its set-points."""

from __future__ import annotations

from swgjoint.envs.api import BatchEnv, SingleEnv
from swgjoint.envs.arm.core import ArmCore
from swgjoint.envs.arm.settings import ArmSettings


class ArmTrackingEnv(SingleEnv):
    """An arm with a drive in every joint tracks the path of a scene, or drawn paths.

    The scene is assembled as by ``swgjoint run``: arm, drives, payload, path (joint or
    Cartesian), step and controller. The controller is PD control of every motor angle
    with feed-forward within the engine's step, and the action is added to it. Catalogue
    drives get the kinematic error that their catalogue states.

    The action is constant over one control period. It is a torque of up to
    ``authority_of_rated`` times rated torque over ratio (the authority) or, with
    ``action="setpoint"``, a shift of the link set-points of up to ``shift_arcmin``:

    =====  =======================================================  ====  =======
    index  meaning                                                  unit  range
    =====  =======================================================  ====  =======
    0-5    added motor torque of every joint relative to authority  1     -1 to 1
    =====  =======================================================  ====  =======

    Observation for scene ``ur5e-circle``; the last two entries exist only with
    ``sensors={"link_encoder": True, "torque_sensor": True}``. They are followed by the
    output torque that strain gauges read [N·m], one entry for each joint to which the
    scene gives gauges, in the order of the joints:

    =====  =====================================  =====  =============
    index  meaning                                unit   range
    =====  =====================================  =====  =============
    0-5    measured motor angle of every joint    rad    -230 to 230
    6-11   measured motor speed of every joint    rad/s  -240 to 240
    12-17  motor angle error of every joint       rad    -1.6 to 1.6
    18-23  motor speed error of every joint       rad/s  -15 to 15
    24-29  reference speed of every link          rad/s  -0.69 to 0.69
    30-35  known torque of every link             N·m    -30 to 30
    36-41  last action for every joint            1      -1 to 1
    42-47  measured link angle of every joint     rad    -2.3 to 2.3
    48-53  measured output torque of every joint  N·m    -410 to 410
    =====  =====================================  =====  =============

    Measured speeds, errors and their ranges are defined as in
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`. The known torque is that of
    inertia, weight and load on the path.

    The reward of a step depends on the distance d of the tool from its reference
    (linearised about the reference) and on the actions a:

        1/(1 + (d/error_scale)^2) - effort_weight mean(a^2)

    Drawn paths begin at rest at the start of the scene. Joint motions are those of
    ``JointTracking-v0``, independent for every joint. Curves of the tool (``line``,
    ``arc`` of a circle of 90 to 360 degrees, ``spline``) have random directions; the
    tool moves along the curve and half the way back, and arms with six or more joints
    keep its orientation. 40 to 100 % of the largest size that the limits allow is
    drawn; curves are cut off where a joint would exceed its limits. Paths do not leave
    the ranges of the joints and are smaller where bodies would touch; one of which less
    than a tenth would remain is drawn again.

    An episode starts at rest at the start of the scene, and the drives carry weight and
    load. It is ``truncated`` after ``episode_s``, or at the end of the scene if it is
    earlier and the path is that of the scene. It is ``terminated`` when a limit is
    exceeded (``info["broken_limit"]``, see
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`): a link 0.3 rad beyond the
    range of the path, a motor 20 rad/s beyond twice the largest speed of the path, or a
    drive above its momentary peak or ratcheting torque. With drawn paths, the limits of
    their angles and speeds take the place of the path. ``info`` is the same as there,
    with arrays over the joints, and also contains ``tool_error_mm`` and, if payloads
    are drawn, ``payload_kg``.

    Args (all by keyword):
        scene: Name or path of a scene that starts at rest, or of an arm, whose joints
            are then swept with motor loops without integral terms. Default:
            ``ur5e-circle``.
        reference: ``scene`` for the path of the scene, or one or several of
            ``sinusoid``, ``multisine``, ``point_to_point`` (joint motions), ``line``,
            ``arc`` and ``spline`` (curves of the tool), of which every episode draws
            one. Default: ``scene``.
        max_speed_rad_s: Largest joint speed of drawn paths [rad/s]. The largest
            acceleration is this speed divided by 12 ms. Default: 0.6.
        max_angle_rad: Largest deviation of a joint angle from the start on drawn paths
            [rad]. Default: 0.5.
        max_distance_mm: Largest distance of the tool from its start on drawn curves of
            the tool [mm]. Default: 100.
        payload_kg: Payload at the tool, a point mass that replaces the payload of the
            scene [kg]. With a range (smallest, largest), every episode draws a mass;
            ``task`` and feed-forward then know the mean of the range, and the episode
            starts where the motor loops carry the drawn mass. Default: None, which uses
            the payload of the scene.
        payload_centre_mm: Centre of mass of ``payload_kg`` in the frame of the tool
            [mm]. Default: (0, 0, 0).
        level: ``full`` or ``linear``. Default: ``full``.
        friction: Whether drives have the friction of their maps; overrides the scene.
            Default: True.
        kinematic_error_arcmin: As in ``JointTracking-v0``; overrides the scene. The
            phases differ between joints.
        action: ``torque`` or ``setpoint``. Default: ``torque``.
        authority_of_rated: Largest added motor torque relative to rated torque over
            ratio [-]. Default: 0.2.
        shift_arcmin: Largest shift of the set-points [arcmin]. Default: 10.
        episode_s: Duration of an episode [s]. Default: 2.
        sensors: As in ``JointTracking-v0``.
        randomise: As in ``JointTracking-v0``, but ``load_inertia`` has no effect
            because ``payload_kg`` changes the load. With level ``linear``, True
            therefore varies nothing.
        normalise: As in ``JointTracking-v0``. Default: True.
        error_scale_mm: Error scale of the reward [mm]. Default: 1.
        effort_weight: Effort weight of the reward [-]. Default: 0.1.

    Version: v0.
    """

    core_of = ArmCore
    settings_type = ArmSettings


class ArmTrackingVectorEnv(BatchEnv):
    """Many episodes of :class:`ArmTrackingEnv` on the threads of the engine."""

    single = ArmTrackingEnv
