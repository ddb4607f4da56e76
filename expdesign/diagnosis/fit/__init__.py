"""Gauss-Newton fits of effects and parameters to all windows, with their noise, covariance and cross-validation.

A `Fit` holds a model, the noise of its remainder and the linear model around it. `fit` finds one, `log_likelihood_gain`
compares two, `counting_runs` corrects standard errors, `cross_validate` measures errors on held-out data.
"""

from expdesign.diagnosis.fit.between_runs import (
    NOISE_ALONE,
    counting_runs,
    counting_stretches,
    directions_between_runs,
    of_several,
    runs_of,
    tail,
)
from expdesign.diagnosis.fit.cross_validation import (
    FOLDS,
    CrossValidation,
    cross_validate,
    cross_validate_ahead,
    validation_units,
)
from expdesign.diagnosis.fit.fit import (
    Fit,
    FitOptions,
    beyond_stated_std,
    continuing,
    deviations_of,
    likeliest,
    log_likelihood_gain,
    profile_cost,
    uncertain_keys,
    unmeasured_force_share,
    within_stated_std,
)
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.fit.held_out import (
    BLOCK_S,
    FEWEST_RUNS,
    LEAST_ERROR,
    HeldOut,
    certain_reductions,
    gains_for_certain,
    held_out_gain,
    judged,
    leads_away,
    on_common_units,
    prediction_gain,
    prediction_p_value,
)
from expdesign.diagnosis.fit.linear_model import (
    build_sensitivities,
    difference_step,
    effect_disturbances,
    gram_matrices,
    in_groups,
    marginalised,
    sensitivities_to,
    window_information,
)
from expdesign.diagnosis.fit.output_error import AHEAD_S, fit_ahead, fit_output_error, no_smaller, with_longer_windows
