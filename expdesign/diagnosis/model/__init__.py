"""The simulation model with effects added to it: its terms, the term library and the groups of inputs."""

from expdesign.diagnosis.model.extended_model import ANGLE_STEMS, ROLL, ExtendedModel, mean_wind
from expdesign.diagnosis.model.input_groups import (
    RESPONSES,
    group_columns,
    input_groups,
    response_effect,
    values_by_group,
)
from expdesign.diagnosis.model.term_library import ADVANCE_LOSS, AIR, own_advance_terms, own_air_terms, term_library
from expdesign.diagnosis.model.terms import (
    Effects,
    ScaledTerm,
    ahead_force,
    ahead_force_text,
    asymmetry_terms,
    is_coriolis,
    is_damping,
    is_thrust,
    reads_rudder,
    resisting,
    term_factors,
    turns_by_force,
)

__all__ = [
    "ADVANCE_LOSS",
    "AIR",
    "ANGLE_STEMS",
    "RESPONSES",
    "ROLL",
    "Effects",
    "ExtendedModel",
    "ScaledTerm",
    "ahead_force",
    "ahead_force_text",
    "asymmetry_terms",
    "group_columns",
    "input_groups",
    "is_coriolis",
    "is_damping",
    "is_thrust",
    "mean_wind",
    "own_advance_terms",
    "own_air_terms",
    "reads_rudder",
    "resisting",
    "response_effect",
    "term_factors",
    "term_library",
    "turns_by_force",
    "values_by_group",
]
