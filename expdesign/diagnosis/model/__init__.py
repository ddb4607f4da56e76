"""The simulation model with effects added to it: its terms, the term library and the groups of inputs."""

from expdesign.diagnosis.model.extended_model import ANGLE_STEMS, ROLL, ExtendedModel, mean_wind
from expdesign.diagnosis.model.terms import (
    ADVANCE_LOSS,
    AIR,
    FOLLOWING,
    LEAST_EFFECT,
    RESPONSES,
    Effects,
    ScaledTerm,
    ahead_force,
    ahead_force_text,
    asymmetry_terms,
    group_columns,
    input_groups,
    is_coriolis,
    is_damping,
    is_thrust,
    own_advance_terms,
    own_air_terms,
    reads_rudder,
    resisting,
    response_effect,
    term_factors,
    term_library,
    turns_by_force,
    values_by_group,
)
