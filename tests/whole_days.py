"""Whole days of a plan, simulated with noisy sensors and estimated from: are they as accurate as stated?"""

from __future__ import annotations

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.information import estimated_parameters
from expdesign.rehearsal.validation import Rehearsal, Validated, validate
from expdesign.scenario import Scenario
from expdesign.signals import Commands
from expdesign.simulation import CALM, Environment, simulate


def simulated_days(
    case: Scenario,
    commands: Commands,
    *,
    trials: int,
    environment: Environment = CALM,
    method: str = "iv",
    seed: int = 0,
) -> Validated:
    """Estimates by a method from so many days of a plan, legs included, beside what is predicted.

    The commands are those of the plan; the whole day is one batch of data.
    """
    vessel = case.vessel
    day = Primitive(
        name="day",
        family="recorded",
        settings={"duration_s": commands.duration_s},
        commands=commands,
        entry_inputs=np.zeros(len(vessel.limits)),
        trajectory=simulate(vessel, commands, velocity=np.zeros(3), standing=np.zeros(len(vessel.limits))),
    )
    rehearsal = Rehearsal(
        truth=vessel,
        nominal=vessel,
        primitives=(day,),
        designs={"day": (1,)},
        total_s=commands.duration_s,
        environment=environment,
        method=method,
        parameters=estimated_parameters(vessel.model, case.design.fixed_parameters),
        mean_subtraction=case.design.mean_subtraction,
        integrator="rk4" if vessel.model.form == "continuous" else "euler",
        trials=trials,
        seed=seed,
    )
    (found,) = validate(rehearsal)
    return found


def chance(trials: int) -> float:
    """Relative standard error of a standard deviation found in so many trials of normal estimates."""
    return float(1 / np.sqrt(2 * (trials - 1)))
