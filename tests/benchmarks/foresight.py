"""What is foreseen against whole diagnoses of simulated trials, in which an effect is hidden at a chosen power.

`python tests/benchmarks/foresight.py` writes the table of the README beside this file: for every effect the predicted
and the observed shares of trials in which the likelihood ratio test accepts it, in which the diagnosis finds its cause,
and in which it names it first.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from expdesign.diagnosis import diagnose
from expdesign.diagnosis.motion import initial_states, stable_windows
from expdesign.diagnosis.select import fit_nuisance, score_tests
from expdesign.diagnosis.select.fitted_candidate import fit_candidate
from expdesign.diagnosis.select.starting_point import starting_point
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.dictionary import build_dictionary
from expdesign.foresight import (
    Foreseen,
    background,
    design_runs,
    foresee,
    needed_noncentrality,
    simulated_record,
    weather_without_causes,
    with_effect,
)
from expdesign.scenario import load_scenario
from expdesign.signals import Record
from expdesign.vessel import Vessel

STORY = Path(__file__).parents[2] / "scenarios" / "story.toml"
RUNS = {"zigzag-speed-1.4": 1, "sway-zigzag-sway-0.6": 1, "telegraph": 1}
EFFECTS = ("inertia_factor_r", "velocity_angle_rad", "forward_m", "thrust_offset_m", "Y_abs_v_v", "lag_all_s", "factor")


def drawn(vessel: Vessel, rng: np.random.Generator) -> Vessel:
    """The vessel with parameters as wrong as its file says they may be."""
    model = vessel.model
    values = model.parameters + model.parameter_std * rng.standard_normal(len(model.parameters))
    return replace(vessel, model=model.with_parameters(values))


def main() -> None:
    """Print one row for every effect and power."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--trials", type=int, default=25)
    arguments.add_argument("--powers", type=float, nargs="+", default=[0.5, 0.9])
    arguments.add_argument("--effects", nargs="+", default=EFFECTS)
    arguments.add_argument("--test-only", action="store_true", help="no whole diagnoses, which take most of the time")
    asked = arguments.parse_args()
    case = load_scenario(STORY)
    primitives = build_dictionary(case.vessel, case.dictionary)
    runs = design_runs(primitives, [RUNS.get(item.name, 0) for item in primitives])
    vessel, weather = case.vessel, weather_without_causes(case.vessel, case.environment)
    known = background(vessel, runs, case.environment)
    stated = known.base.ship.without_effects({*known.base.keys})
    first = {item.name: item for item in foresee(vessel, runs, case.environment).effects if item.cause != "thrust_gain"}
    print(
        "| effect | size | power | accepted by its test | foreseen to be found | found | foreseen to be first "
        "| named first |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name in asked.effects:
        for wanted in asked.powers:
            item = first[name]
            scale = np.sqrt(needed_noncentrality(wanted, item.freedom, item.level) / item.noncentrality)
            size = float(abs(item.change) * scale)
            again = foresee(vessel, runs, case.environment, sizes={item.cause: size}).effects
            (at,) = [one for one in again if one.name == name and one.cause == item.cause]
            shares = np.zeros(3)
            for trial in range(asked.trials):
                rng = np.random.default_rng([trial, round(1000 * wanted)])
                truth = with_effect(drawn(vessel, rng), stated, item.effect.directions[0], size)
                record = simulated_record(truth, runs, weather, rng)
                shares[0] += _accepted(vessel, record, item)
                if not asked.test_only:
                    found = [one.cause for one in diagnose(vessel, record, seed=trial).findings]
                    shares[1:] += [item.cause in found, found[:1] == [item.cause]]
            accepted, *whole = shares / asked.trials
            found_share, named = ("-", "-") if asked.test_only else (f"{share:.2f}" for share in whole)
            print(
                f"| {item.cause}: {name} | {size:.3g} {item.unit} | {at.power:.2f} | {accepted:.2f} | "
                f"{at.found:.2f} | {found_share} | {at.named:.2f} | {named} |",
                flush=True,
            )


def _accepted(vessel: Vessel, record: Record, item: Foreseen) -> bool:
    ship = extended_model(vessel, record)
    windows = stable_windows(ship, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    (test,) = score_tests(base, [item.effect.candidate])
    fitted = fit_candidate(base, windows, starting_point(base, test))
    return fitted is not None and chi2.sf(fitted.likelihood_gain, item.freedom) <= item.level


if __name__ == "__main__":
    main()
