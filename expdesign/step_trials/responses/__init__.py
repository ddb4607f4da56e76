"""Responses to steps: one by one, and with a shape in common."""

from expdesign.step_trials.responses.shared_shape import shared_delay
from expdesign.step_trials.responses.transients import (
    Response,
    Transient,
    first_order,
    fit_first_order,
    fit_second_order,
    preference,
    second_order,
)

__all__ = [
    "Response",
    "Transient",
    "first_order",
    "fit_first_order",
    "fit_second_order",
    "preference",
    "second_order",
    "shared_delay",
]
