"""Measured batches for a diagnosis: windows, measured channels and noise."""

from expdesign.diagnosis.data.noise import (
    Noise,
    before_windows,
    channel_std,
    fit_ar_noise,
    linear_basis,
    random_current_precision,
    white_noise,
    whitened,
)
from expdesign.diagnosis.data.sampled_batch import (
    averaging_half_width,
    derived_outputs,
    has_heading,
    has_wind,
    missing_wind_share,
)
from expdesign.diagnosis.data.windows import Windows, cut_windows
