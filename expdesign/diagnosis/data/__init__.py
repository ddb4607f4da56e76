"""Measured batches as a diagnosis reads them: windows, and the noise in them."""

from expdesign.diagnosis.data.noise import Noise, fit_colour, hats, wander_covariance, white_noise, whitened
from expdesign.diagnosis.data.spread import spread
from expdesign.diagnosis.data.windows import Windows, cut_windows, derived_outputs, half_width, has_heading, unseen_wind

__all__ = [
    "Noise",
    "Windows",
    "cut_windows",
    "derived_outputs",
    "fit_colour",
    "half_width",
    "has_heading",
    "hats",
    "spread",
    "unseen_wind",
    "wander_covariance",
    "white_noise",
    "whitened",
]
