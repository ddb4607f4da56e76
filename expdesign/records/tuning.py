"""The tuning constants of reading measured data, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Thresholds that separate data from errors in data.

    Attributes:
        read_bytes: bytes read at once while a file is checked to be text.
        block_rows: rows held as text at once.
        gap_sample_times: interval, in sample times, above which a new batch starts.
        gap_share: share of intervals that may be gaps before the sampling counts as irregular.
        jitter_share: largest deviation of an interval from the sample time, as a share of it.
        sample_time_mismatch: largest relative difference of two sample times that count as equal.
        longest_sample_time_s: limit of IMO MSC/Circ.1053 for manoeuvring trials [s].
        shortest_sample_time_s: limit below which the unit of time is questioned [s].
        largest_number: limit above which a number is an error.
        listed_rows: stretches of rows that a message lists.
        wind_disagreement: relative difference between vane and components that gets a note.
        wind_explained: remaining relative difference at which a wrong direction convention is the explanation.
        window_s: interval over which changes of the pose are compared with velocities [s].
        pose_disagreement: relative difference of both changes (root mean square) that gets a note.
        pose_suspicion: relative difference above which an explanation is searched for.
        pose_explained: share of the difference that may remain with an explanation.
        course_spread: circular variance of course less heading below which it is not questioned.
        course_axis_rad: distance of an axis at which headings may begin [rad].
        equally_good: ratio of remaining differences below which explanations are named together.
        turning_rad: change of heading over a window (root mean square) below which no turn is compared [rad].
        jump_ratio: a step above this multiple of the 95th percentile of all changes gets a note.
        log10_ratios: range of q Ts^3 / variance of the smoother, from strong smoothing to none.
        learning_samples: samples, from the middle, from which the smoother learns its ratio.
        shortest_smoothed: samples that the smoother needs.
        held_share: share of repeated positions of a moving ship above which they count as held values.
        limit_slack: share of an actuator's limit by which a recorded input may exceed it.
        most_beyond: share of rows beyond the limits above which a file is refused.
        far_beyond: multiple of a limit from which another unit is thought of.
        sideways_ratio: sway over surge (root mean square) above which the axes of the pose are questioned.
    """

    read_bytes: int = 1 << 20
    block_rows: int = 4096
    gap_sample_times: float = 1.5
    gap_share: float = 0.2
    jitter_share: float = 0.25
    sample_time_mismatch: float = 0.01
    longest_sample_time_s: float = 20.0
    shortest_sample_time_s: float = 1e-4
    largest_number: float = 1e15
    listed_rows: int = 3
    wind_disagreement: float = 0.3
    wind_explained: float = 0.1
    window_s: float = 10.0
    pose_disagreement: float = 0.3
    pose_suspicion: float = 0.1
    pose_explained: float = 0.25
    course_spread: float = 0.02
    course_axis_rad: float = 0.5
    equally_good: float = 1.5
    turning_rad: float = 0.05
    jump_ratio: float = 10.0
    log10_ratios: tuple[float, float] = (-9.0, 6.0)
    learning_samples: int = 8192
    shortest_smoothed: int = 4
    held_share: float = 0.5
    limit_slack: float = 0.02
    most_beyond: float = 0.5
    far_beyond: float = 3.0
    sideways_ratio: float = 2.0


TUNING = Tuning()
