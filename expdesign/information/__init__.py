"""Information: moments of regressors and instruments, identifiability."""

from expdesign.information.excitation import excitation_condition, excitation_refusal
from expdesign.information.moments import (
    MEAN_SUBTRACTIONS,
    PrimitiveInformation,
    check_informative,
    estimated_parameters,
    log_det_or_none,
    moments,
    regressor_rows,
)
from expdesign.information.scoring import score_models, score_primitives
