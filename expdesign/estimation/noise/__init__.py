"""The noise in residuals: components, long-run variance and whitening filters."""

from expdesign.estimation.noise.components import Components, Fitted, fit_components
from expdesign.estimation.noise.coupled import Coupled, coupled_covariance, fit_coupled
from expdesign.estimation.noise.long_run import automatic_lags, long_run_covariance, lost_share
from expdesign.estimation.noise.score_covariance import score_covariance
from expdesign.estimation.noise.timeline import Stretch, Timeline, stretches, timeline
from expdesign.estimation.noise.whitening import white_parts

__all__ = [
    "Components",
    "Coupled",
    "Fitted",
    "Stretch",
    "Timeline",
    "automatic_lags",
    "coupled_covariance",
    "fit_components",
    "fit_coupled",
    "long_run_covariance",
    "lost_share",
    "score_covariance",
    "stretches",
    "timeline",
    "white_parts",
]
