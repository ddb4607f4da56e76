"""Which causes explain the data: score tests, forward selection, backward elimination, profile likelihood."""

from expdesign.diagnosis.select.backward_elimination import (
    eliminate_backward,
    gain_beside_the_same_fit,
    improves_held_out,
    only_nuisance,
    simulates_better,
)
from expdesign.diagnosis.select.candidate_disturbances import candidate_disturbances
from expdesign.diagnosis.select.fitted_candidate import FittedCandidate
from expdesign.diagnosis.select.forward_selection import fit_nuisance, select_forward
from expdesign.diagnosis.select.prediction_selection import Compared, ComparedCause, compare_predictions
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.selection import Selection, Step, fitted_ahead, redundant_step, without_step
from expdesign.diagnosis.select.selection_round import leading_candidates, open_candidates, same_effects_as_any
from expdesign.diagnosis.select.tuning import TUNING as SELECTION_TUNING

__all__ = [
    "SELECTION_TUNING",
    "Compared",
    "ComparedCause",
    "FittedCandidate",
    "ScoreTest",
    "Selection",
    "Step",
    "candidate_disturbances",
    "compare_predictions",
    "eliminate_backward",
    "fit_nuisance",
    "fitted_ahead",
    "gain_beside_the_same_fit",
    "improves_held_out",
    "leading_candidates",
    "only_nuisance",
    "open_candidates",
    "redundant_step",
    "same_effects_as_any",
    "score_tests",
    "select_forward",
    "simulates_better",
    "without_step",
]
