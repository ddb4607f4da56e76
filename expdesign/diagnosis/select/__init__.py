"""Which causes explain the data: score tests, forward selection, backward elimination, profile likelihood."""

from expdesign.diagnosis.select.backward_elimination import (
    as_told,
    certain_in_predictions,
    compared_with,
    eliminate_backward,
    improves_held_out,
    only_nuisance,
    shows_for_certain,
    simulates_better,
    two_runs_by_predictions,
)
from expdesign.diagnosis.select.fitted_candidate import FittedCandidate, Rival
from expdesign.diagnosis.select.forward_selection import fit_nuisance, select_forward
from expdesign.diagnosis.select.kinks import with_honest_errors
from expdesign.diagnosis.select.score_tests import ScoreTest, candidate_disturbances, score_tests
from expdesign.diagnosis.select.selection import (
    Selection,
    Step,
    fitted_ahead,
    p_value_between_runs,
    redundant_step,
    wald_p_value,
    with_p_values_beside_all,
    without_step,
)
from expdesign.diagnosis.select.selection_round import leading_candidates, open_candidates, same_effects_as_any
from expdesign.diagnosis.select.starting_point import StartingPoint, joint_keys, starting_point
from expdesign.diagnosis.select.suspected import Suspected, suspected_tests
from expdesign.diagnosis.select.tuning import TUNING as SELECTION_TUNING
