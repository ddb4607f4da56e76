"""Numbers that steer measures of accuracy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room.

    Attributes:
        horizons_s: times after a start at which the growth of the error is measured [s].
        largest_error: errors beyond so many standard deviations of the measurements count as that large; the simulation
            has diverged, and the size of its error has no meaning.
        stretch_samples: of a stretch of the residual analysis.
        fewest_measured: samples of a stretch that must be measured.
        groups: of stretches with similar values of a variable.
        fewest_stretches: for a test.
        largest_autocorrelation, smallest_autocorrelation: of successive residuals, beyond which they are bounded and
            ignored.
        fewest_samples: for a diagnosis.
        constant_range: range of a constant input, as a share of its size.
        least_response: response of the motion to the inputs' changes, in standard deviations of the noise, at least.
    """

    horizons_s: tuple[float, ...] = (2.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0)
    largest_error: float = 10.0
    stretch_samples: int = 10
    fewest_measured: int = 5
    groups: int = 8
    fewest_stretches: int = 16
    largest_autocorrelation: float = 0.9
    smallest_autocorrelation: float = 0.01
    fewest_samples: int = 100
    constant_range: float = 1e-9
    least_response: float = 0.5


TUNING = Tuning()
