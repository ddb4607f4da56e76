"""The noise in residuals: components, long-run variance and whitening filters."""

from expdesign.estimation.noise.components import (
    Components,
    Fitted,
    Stretch,
    Timeline,
    fit_components,
    stretches,
    timeline,
)
from expdesign.estimation.noise.coupled import coupled_covariance, fit_coupled
from expdesign.estimation.noise.covariance import (
    SPECTRUM_MISFIT,
    WHITENING_PASSES,
    automatic_lags,
    long_run_covariance,
    lost_share,
    score_covariance,
    white_parts,
)
