"""Accuracy of the simulation, one-step residuals, and excitation by the inputs."""

from expdesign.diagnosis.accuracy.excitation import check_excitation, constant_inputs, white_noise_std
from expdesign.diagnosis.accuracy.residuals import Dependence, Residuals, dependence, mean_residual, one_step_residuals
from expdesign.diagnosis.accuracy.simulated_fit import WHOLE_S, Accuracy, accuracy, pooled_fit, squared_sums

__all__ = [
    "WHOLE_S",
    "Accuracy",
    "Dependence",
    "Residuals",
    "accuracy",
    "check_excitation",
    "constant_inputs",
    "dependence",
    "mean_residual",
    "one_step_residuals",
    "pooled_fit",
    "squared_sums",
    "white_noise_std",
]
