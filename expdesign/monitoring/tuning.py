"""The tuning constants of monitoring, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Sizes, lengths and limits.

    Attributes:
        stretch_s: length of the stretches that are simulated [s], for a ship of `length_m`.
        length_m: see there [m].
        fewest_samples: measured samples of a stretch that is judged.
        iterations: of the expectation-maximisation of noise and force.
        fewest_stretches: of a reference.
        block_counts: blocks into which the reference is cut to measure how scores of neighbouring stretches correlate;
            the largest inflation counts.
        misfit_deviations: standard deviations of the reference's misfit beyond which a stretch is not judged.
        weather_stretches: over which the surprise of the force is averaged.
        weather_limit: surprise of a stretch, in that of the reference, beyond which the weather is unlike it.
        told_apart: stretches of a sum from which weather beyond the reference is told from a change of the ship, and
            the same where the sum began in such weather.
        unexplained_share: of the surprise, that the effects of large changes leave as they are not linear.
        settling_stretches: fewest from which the size of a change is told.
        refined: change of the size, in sizes that matter, below which it is refined no further.
        clear: standard errors from which a size from the data since the last refinement takes the place of that one.
        largest_size: of changes that are told from errors unlike the reference's, in sizes that matter.
        as_likely: difference of log-likelihood up to which another change explains the data as well.
        settled: information, in inverse squared sizes, from which a change is settled; patience: factor of it where
            other changes explain the data as well.
        known_within: a change is watched for where its size is so many standard errors of the reference.
        quick_s, slow_s: correlation times of the unmeasured force: first guess of the quick one, and the slow one [s].
        spare: variance of the slow part beside what the reference shows, as a multiple of it and by the number of times
            `slow_s` that the reference covers.
        searched_stretches: of a reference, from which the variation of the force is learnt.
        search_rounds, search_gain: rounds of that search, and the least gain of twice the log-likelihood in one.
        relative_size: change of a parameter, a gain or an inertia that matters, as a share.
        angle_rad: misalignment that matters [rad].
        gyro_share: change of the gyro's scale that matters.
        still_mps, still_mps2: speed and acceleration by propulsion below which a ship lies still [m/s, m/s2].
        turned_rad, gained_share: change of heading in a stretch that counts as a turn [rad], and of speed, as a share.
        loads: kinds of effects that a load may change, each with the standard deviation of its change in a port call,
            in sizes that matter.
        load_settled: stretches after a port call from which its load is taken for the ship's, and again.
        largest_speed: speed beyond which a simulation has diverged [m/s, rad/s].
    """

    stretch_s: float = 60.0
    length_m: float = 20.0
    fewest_samples: int = 15
    iterations: int = 60
    fewest_stretches: int = 40
    block_counts: tuple[int, ...] = (160, 80, 40, 20)
    misfit_deviations: float = 6.0
    largest_size: float = 10.0
    as_likely: float = 3.0
    weather_stretches: float = 30.0
    weather_limit: float = 1.7
    told_apart: tuple[int, int] = (7, 20)
    unexplained_share: float = 0.1
    settling_stretches: int = 20
    refined: float = 0.2
    clear: float = 2.0
    settled: float = 60.0
    patience: float = 10.0
    known_within: float = 6.0
    quick_s: float = 300.0
    slow_s: float = 43200.0
    spare: float = 8.0
    searched_stretches: int = 600
    search_rounds: int = 12
    search_gain: float = 0.5
    relative_size: float = 0.1
    angle_rad: float = 0.03
    gyro_share: float = 0.05
    still_mps: float = 0.3
    still_mps2: float = 1e-3
    turned_rad: float = 0.26
    gained_share: float = 0.15
    loads: tuple[tuple[str, float], ...] = (("inertia", 2.0), ("hull", 1.0))
    load_settled: tuple[int, ...] = (2, 6, 20, 60, 240)
    largest_speed: float = 100.0


TUNING = Tuning()
