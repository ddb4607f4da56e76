"""Which causes explain the data: score tests, forward selection, backward elimination, profile likelihood."""

from expdesign.diagnosis.select.backward_elimination import (
    eliminate_backward,
    falls_for_certain,
    gain_beside_the_same_fit,
    improves_held_out,
    only_nuisance,
    simulates_better,
)
from expdesign.diagnosis.select.candidate_disturbances import candidate_disturbances
from expdesign.diagnosis.select.fitted_candidate import FittedCandidate
from expdesign.diagnosis.select.forward_selection import fit_nuisance, select_forward
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.selection import Selection, Step, fitted_ahead, redundant_step, without_step
from expdesign.diagnosis.select.selection_round import leading_candidates, open_candidates, same_effects_as_any
from expdesign.diagnosis.select.starting_point import StartingPoint, joint_keys, starting_point
from expdesign.diagnosis.select.tuning import TUNING as SELECTION_TUNING

__all__ = [
    "SELECTION_TUNING",
    "FittedCandidate",
    "ScoreTest",
    "Selection",
    "StartingPoint",
    "Step",
    "candidate_disturbances",
    "eliminate_backward",
    "falls_for_certain",
    "fit_nuisance",
    "fitted_ahead",
    "gain_beside_the_same_fit",
    "improves_held_out",
    "joint_keys",
    "leading_candidates",
    "only_nuisance",
    "open_candidates",
    "redundant_step",
    "same_effects_as_any",
    "score_tests",
    "select_forward",
    "simulates_better",
    "starting_point",
    "without_step",
]
