"""The tuning constants of the kinematic checks, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Constants that were chosen, not derived.

    Attributes:
        fewest_held: samples from which a signal is asked whether it is held.
        most_changes: share of samples that change, or bend, above which every sample may be a reading.
        bend: multiple of rounding above which a bend shows a reading.
        unbent: share of samples between readings, whose bends are rounding.
        straight: bend of a line, as a share of its usual step, above which it is none.
        single: multiple of the usual gap between changes up to which a gap may be one interval.
        tried: intervals that are tried around the mean of the gaps.
        fewest_changes: from which an interval is found.
        whole: standard errors within which an interval counts as a whole number of samples.
        shortest_interval: of readings [samples].
        various: share of gaps of several intervals that a rounded signal must have.
        even: share of changes that an interval must explain.
        uneven: spread of the gaps, as a share of the interval, up to which a signal is held at about that interval.
        phases: changes whose phases are tried.
        one_size: multiple of the smallest change below which another is of the same size.
        mostly_one: share of changes of one size above which a signal is rounded.
        lengths: ship lengths sailed in a window.
        window_samples: fewest samples of a window.
        longest_window_s: of a window [s].
        windows: least length of a stretch, in windows.
        blocks: stretches that the record is cut into, each left out in turn for the standard errors.
        fewest_blocks: with which a comparison is made.
        certain: standard errors from what would be right at which a finding is told.
        scale_std: standard error of a scale, at least: readings of several samples, rounding and filters in instruments
            change scales by about as much.
        scale_matters: change of a scale that is told.
        sway_within: factor within which the scale of sway is that of surge; beyond, sway is hardly more than noise.
        turn_matters_rad: misalignment that is told [rad].
        rate_matters: bias of a rate, as a share of its root mean square, that is told.
        place_std: standard error of a place, at least, in ship lengths: small differences of clocks imitate that.
        place_matters: distance of an instrument, in ship lengths, that is told.
        delay_matters: of one instrument after another, in samples, that is told; Euler's map alone gives a half.
        delay_std: standard error of a delay, at least, in samples.
        delay_rounds: in which the delay of a log is found.
        way_matters: steady difference of velocities, as a share of the speed, that is told.
        told, told_way: least share of a regressor that the others do not explain; that of a way, which is measured
            better than most.
        on_course: share of the expected distance of the place that does not drift in turns below which a heading is one
            of the track.
        drifts: that distance of ships, at least, from which the drift is expected.
        on_track: share of the expected drift below which heading and course are the same.
        turning: drift expected in turns [rad], root mean square, from which heading and course can be told apart.
        faster: multiple of a stated rate above which an input moves faster than stated.
        ramp, fewest_ramps: samples of an even movement, and how many of them tell.
        ramps: share of the fast samples that must be inside such movements.
        ramp_spread: median deviation from their speed, as a share of it.
        opposed: least and most size of an answer to an input, in units of the model's, that has the wrong sign.
        opposed_share: share of the changes that the input explains then.
        alike: factor from one within which an answer is that of the model.
        turned_rad, turned_share: turn against a held input, and its share of all turns, that count as opposed.
        pushing: share of an input's largest effect below which it is not held to any side.
    """

    fewest_held: int = 40
    most_changes: float = 0.7
    bend: float = 2.5
    unbent: float = 0.6
    straight: float = 1e-3
    single: float = 1.5
    tried: int = 41
    fewest_changes: int = 8
    whole: float = 0.5
    shortest_interval: float = 1.5
    various: float = 0.3
    even: float = 0.95
    uneven: float = 0.25
    phases: int = 50
    one_size: float = 1.5
    mostly_one: float = 0.8
    lengths: float = 1.0
    window_samples: int = 5
    longest_window_s: float = 60.0
    windows: float = 1.5
    blocks: int = 20
    fewest_blocks: int = 8
    certain: float = 6.0
    scale_std: float = 0.001
    scale_matters: float = 0.02
    sway_within: float = 1.5
    turn_matters_rad: float = 0.0175
    rate_matters: float = 0.1
    place_std: float = 0.001
    place_matters: float = 0.05
    delay_matters: float = 0.6
    delay_std: float = 0.05
    delay_rounds: int = 2
    way_matters: float = 0.05
    told: float = 0.02
    told_way: float = 0.002
    on_course: float = 0.5
    drifts: float = 0.2
    on_track: float = 0.5
    turning: float = 0.02
    faster: float = 1.2
    ramp: int = 3
    fewest_ramps: int = 3
    ramps: float = 0.3
    ramp_spread: float = 0.15
    opposed: tuple[float, float] = (0.1, 10.0)
    opposed_share: float = 0.3
    alike: float = 3.0
    turned_rad: float = 1.6
    turned_share: float = 0.95
    pushing: float = 0.1


TUNING = Tuning()
