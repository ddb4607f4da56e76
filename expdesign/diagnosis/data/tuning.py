"""Numbers that steer how data are cut and how noise is modelled."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room.

    Attributes:
        coarsest_step_s: integrator step, at most [s]; faster data are averaged over it.
        step_share: integrator step as a share of the ship's shortest time constant, at most.
        longest_window: compared samples, at most.
        fewest_in_window: compared samples, at least.
        same_time: relative difference up to which sample times count as equal.
        ar_orders: of the autoregressions that are tried.
        samples_per_order: of a window, for each order of its autoregression, at least.
        lags: of differences of white noise that are tried [samples]; one for those of means whose samples meet.
        white_share: of the remainder's variance that is always taken as white. No model is right at every frequency,
            and smoothed data would otherwise give the fastest motions, of which they show nothing, the most weight.
    """

    coarsest_step_s: float = 1.0
    step_share: float = 0.4
    longest_window: int = 700
    fewest_in_window: int = 4
    same_time: float = 1e-6
    ar_orders: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12)
    samples_per_order: int = 6
    lags: tuple[int, ...] = (1, 2)
    white_share: float = 0.05


TUNING = Tuning()
