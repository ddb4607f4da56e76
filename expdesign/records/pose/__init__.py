"""Pose and velocity: positions, derived velocities, and whether they agree."""

from expdesign.records.pose.agreement import check_agreement, check_heading, check_speed, mirrored_heading
from expdesign.records.pose.motion import (
    MEASURED,
    SMOOTHED,
    VELOCITY_METHODS,
    Request,
    batch_velocity,
    central_difference,
    kept_samples,
    left_out_notes,
    long_enough,
    needed_columns,
    origin_notes,
    smoothed_velocity,
    velocity_origins,
)
from expdesign.records.pose.position import Fix, check_jumps, last_fix, with_continuous_angles, with_metres
