"""One joint turns at constant speed under load; the action removes the ripple."""

from __future__ import annotations

from swgjoint.envs.api import BatchEnv, SingleEnv
from swgjoint.envs.ripple_core import RippleCore, RippleEpisode, RippleSettings


class RippleSuppressionEnv(SingleEnv):
    """A joint turns at constant speed under load; the action adds a motor torque.

    The motor loop of the servo drive (:class:`swgjoint.envs.loop.MotorLoop`) is PD
    control of the motor angle with feed-forward of load and acceleration. Its natural
    frequency ``loop_Hz`` and damping ratio ``loop_damping_ratio`` apply to a joint with
    a rigid drive. The kinematic error and the torque ripple that it causes have even
    orders of the wave-generator angle, whose sine and cosine are observed.

    The action is constant over one control period. The authority is
    ``authority_of_rated`` times rated torque over ratio:

    =====  ========================================  ====  =======
    index  meaning                                   unit  range
    =====  ========================================  ====  =======
    0      added motor torque relative to authority  1     -1 to 1
    =====  ========================================  ====  =======

    Observation with the default arguments; entries 9 and 10 exist only with
    ``sensors={"link_encoder": True, "torque_sensor": True}``, the last one only with
    ``gauges={"flexspline": "size-25-100", "position_mm": 13.0, "strain": "outline"}``:

    =====  ===========================================  =====  ===========
    index  meaning                                      unit   range
    =====  ===========================================  =====  ===========
    0      measured motor angle                         rad    -710 to 710
    1      measured motor speed                         rad/s  -180 to 180
    2      motor angle error                            rad    -1.6 to 1.6
    3      motor speed error                            rad/s  -15 to 15
    4      sine of the measured wave-generator angle    1      -1 to 1
    5      cosine of the measured wave-generator angle  1      -1 to 1
    6      reference speed of the link                  rad/s  -0.6 to 0.6
    7      load torque against the link                 N·m    -44 to 44
    8      last action                                  1      -1 to 1
    9      measured link angle                          rad    -7.1 to 7.1
    10     measured output torque                       N·m    -410 to 410
    11     output torque that strain gauges read        N·m    -470 to 470
    =====  ===========================================  =====  ===========

    Measured speeds, errors and their ranges are defined as in
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`.

    The reward of a step is zero up to 1.5 s. After that it depends on the torque ripple
    r (drive torque minus load and inertia torques of the reference), on the link error
    e minus its running mean (time constant 0.15 s) and on the action a:

        1/(1 + (r/ripple_scale)^2 + (e/error_scale)^2) - effort_weight a^2

    An episode starts with the motor at rest at angle 0 and without load. Speed and
    load, of random size and sign, grow over 0.5 s. The episode is ``truncated`` after
    ``episode_s`` and ``terminated`` as in
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`.

    ``info`` is the same as there, with ``torque_ripple_Nm``,
    ``link_error_ripple_arcmin``, ``transmission_error_ripple_arcmin`` and ``steady``
    (whether the reward counts) in addition. The two error ripples are errors minus
    their running means. They are equal while the motor speed is constant. An added
    torque that makes the link speed constant removes the ripple of the link error but
    not that of the transmission error, because the motor then moves so as to compensate
    the kinematic error.

    Args (all by keyword): those of ``JointTracking-v0`` for bench, drive, sensors,
    gauges, ``randomise`` and ``normalise``, and
        max_angle_rad: Largest link angle of references [rad], at least
            ``max_speed_rad_s`` times ``episode_s``. Default: 3.
        episode_s: Duration of an episode [s]. Default: 4.
        slowest: Smallest speed relative to ``max_speed_rad_s`` [-]. Default: 0.3.
        authority_of_rated: Largest added motor torque relative to rated torque over
            ratio [-]. Default: 0.2.
        loop_Hz: Natural frequency of the motor loop [Hz]. Default: 8.
        loop_damping_ratio: Damping ratio of the motor loop [-]. Default: 1.
        ripple_scale_of_rated: Ripple scale of the reward relative to rated torque [-].
            Default: 0.01.
        error_scale_arcmin: Error scale of the reward [arcmin]. Default: 0.1.
        effort_weight: Effort weight of the reward [-]. Default: 0.1.
        identify: Whether the kinematic error is observed as the motor encoder tells it
            (:mod:`swgjoint.envs.identification`), so that a policy can know the phases
            of a specimen. Four values follow the last action: for the orders 2 and 4 of
            the wave-generator angle, the estimate [rad] and its rate of change [rad/s].
            Default: False.

    Version: v0.
    """

    core_of = RippleCore
    episode_of = RippleEpisode
    settings_type = RippleSettings


class RippleSuppressionVectorEnv(BatchEnv):
    """Many episodes of :class:`RippleSuppressionEnv` on the threads of the engine."""

    single = RippleSuppressionEnv
