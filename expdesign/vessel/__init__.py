"""The vessel: particulars, actuators, term library, model structures, regressors and accelerations."""

from expdesign.vessel.actuators import (
    IDEAL,
    KINDS,
    RATE_UNITS,
    Actuator,
    Limit,
    column_name,
    generalised_force,
    limit_keys,
    response_keys,
    stem,
)
from expdesign.vessel.inverse import (
    Allocator,
    by_force,
    commands_for,
    direct_terms,
    force_matrix,
    pushed_everywhere,
    required_push,
    within_limits,
)
from expdesign.vessel.model import LEAST_KEPT, NOT_SUPPORTED, UNSTATED_SHARE, Inertia, Missed, VesselModel
from expdesign.vessel.quantities import EXACT, SENSORS, Response, Sensors
from expdesign.vessel.roll import NOMINAL, NOT_ACTING_BACK, ROLL_PARAMETERS, Body, Load, Roll, RollPendulum
from expdesign.vessel.structures import NUMPY, SCALAR, STRUCTURES, TERMS, Operators, Term, structure_terms
from expdesign.vessel.vessel import (
    CALM,
    Environment,
    Variation,
    Vessel,
    response_values,
    std_keys,
    with_response_values,
)
