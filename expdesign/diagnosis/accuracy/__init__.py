"""Accuracy of the simulation, one-step residuals, and excitation by the inputs."""

from expdesign.diagnosis.accuracy.excitation import check_excitation, constant_inputs, white_noise_std
from expdesign.diagnosis.accuracy.residuals import Dependence, Residuals, dependence, mean_residual, one_step_residuals
from expdesign.diagnosis.accuracy.simulated_fit import Accuracy, accuracy, squared_sums

__all__ = [
    "Accuracy",
    "Dependence",
    "Residuals",
    "accuracy",
    "check_excitation",
    "constant_inputs",
    "dependence",
    "mean_residual",
    "one_step_residuals",
    "squared_sums",
    "white_noise_std",
]
