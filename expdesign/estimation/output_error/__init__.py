"""Output error: the parameters whose simulations are closest to the measured velocities."""

from expdesign.estimation.output_error.minimise import minimise_output_error
from expdesign.estimation.output_error.problem import ActuatorTime, Begun, Fitting
