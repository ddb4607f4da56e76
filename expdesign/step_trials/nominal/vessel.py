"""From the steps to the nominal vessel model with three degrees of freedom, with the covariance that is left.

Two things are compared with the vessel model of parameters theta. At each plateau, the state at which the model is
steady under the same inputs, found by one Newton step from the measured one, with its errors in U, r and, where it is
measured, v. For each step, the time constant of the model with that of the response: for the throttle (U+ - U-)/2 over
the model's acceleration half way, for the rudder that of sway and yaw together by the area between response and
plateau, T1 + T2 - T3. The sum of squares of both, and of the distance from the vessel file's values in its standard
deviations, is made least. Errors are enlarged where plateaus or steps disagree with the model by more than they should
(R. T. Birge, Physical Review 40, 1932).

That an acceleration is zero must not be fitted as it stands: theta = 0 would do so perfectly. A state can be compared.

Steps of U and r say little about sway. Where sway is not measured, it is taken as steady under the sway parameters of
the vessel file. These keep their values, and their stated errors become errors of the others that depend on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from expdesign.errors import InputError
from expdesign.step_trials.holds import Controls
from expdesign.step_trials.nominal.evidence import evidence
from expdesign.step_trials.nominal.posterior import posterior
from expdesign.step_trials.samples import Delays, StepSample
from expdesign.vessel import Vessel, with_response_values


def nominal_vessel(vessel: Vessel, samples: Sequence[StepSample], delays: Delays, input_names: Sequence[str]) -> Vessel:
    """The vessel with parameters and covariance from its file and the steps.

    Raises:
        InputError: the record has other inputs than the vessel, its model has no surge or yaw, or its file states no
            standard deviations.
        NotInformative: sway has no steady drift.
    """
    model = vessel.model
    if tuple(input_names) != model.inputs:
        raise InputError(
            f"the data give {', '.join(input_names)}, expected the inputs of vessel {vessel.name!r}: "
            f"{', '.join(model.inputs)}"
        )
    if not {"u", "r"} <= set(model.outputs):
        raise InputError(
            f"the model of vessel {vessel.name!r} has equations for {', '.join(model.outputs)}, expected u and r"
        )
    if not model.parameter_std.any():
        raise InputError(
            f"vessel {vessel.name!r} states no [model.parameter_std], so all of its model counts as known: state how "
            "well each parameter is known before the trial"
        )
    value, covariance = posterior(model, evidence(samples, delays))
    return replace(vessel, model=model.with_parameters(value).with_covariance(model.names, covariance))


def with_delays(vessel: Vessel, controls: Controls, delays: Sequence[tuple[float, float] | None]) -> Vessel:
    """The vessel with dead times of throttle and rudder (value and standard error) in its file."""
    found: dict[str, tuple[float, float]] = {}
    for names, delay in zip((controls.throttle, controls.rudder), delays, strict=True):
        found |= {f"{name}_delay_s": delay for name in names if delay is not None}
    std = {**vessel.std, **{name: delay[1] for name, delay in found.items() if delay[0] > 0}}
    actuators = with_response_values(vessel.actuators, {name: delay[0] for name, delay in found.items()})
    return replace(vessel, model=replace(vessel.model, actuators=actuators), std=std)
