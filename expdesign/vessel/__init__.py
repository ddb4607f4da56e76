"""The vessel: particulars, actuators, term library, model structures, regressors and accelerations."""

from expdesign.vessel.actuators import KINDS, Actuator, Limit, column_name, generalised_force
from expdesign.vessel.expressions import NUMPY, SCALAR, Operators
from expdesign.vessel.inverse import allocate, direct_terms, force_matrix, required_force, within_limits
from expdesign.vessel.model import VesselModel
from expdesign.vessel.structures import STRUCTURES, TERMS, Term, structure_terms
from expdesign.vessel.vessel import Sensors, Vessel

__all__ = [
    "KINDS",
    "NUMPY",
    "SCALAR",
    "STRUCTURES",
    "TERMS",
    "Actuator",
    "Limit",
    "Operators",
    "Sensors",
    "Term",
    "Vessel",
    "VesselModel",
    "allocate",
    "column_name",
    "direct_terms",
    "force_matrix",
    "generalised_force",
    "required_force",
    "structure_terms",
    "within_limits",
]
