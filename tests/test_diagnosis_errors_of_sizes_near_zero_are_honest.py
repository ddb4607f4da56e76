"""Standard errors of effects that begin at zero hold the truth where the likelihood is no parabola."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import hidden_effects as sea
from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.causes.candidate import from_zero
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.fit import NOISE_ALONE
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.select.kinks import FROM_ZERO, with_profiled_error
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.vessel.quantities import EFFECTS

WEATHER = sea.Weather(current_std=0.01, wind_std=0.2)
LARGE = {
    "lag:all": 2.0, "delay:all": 2.0, "lead:all": 2.0, "slew:rudder": 30.0, "deadband:rudder": 0.3,
    "shallow:damping": 1.0,
}  # fmt: skip
"""An effect of every kind that begins at zero, and a size that shows."""
SMALL = {
    "lag:all": ({"lag_s": 0.3, "acts_on": 0b11}, 0.3),
    "delay:all": ({"delay_s": 0.4, "acts_on": 0b11}, 0.4),  # the generator knows fifths of a second
    "shallow:damping": ({"shallow_damping": 0.15}, 0.15),
}
"""The generator's name of a small effect, and its size."""


def fitted(key: str, seed: int, hidden: dict | None = None):
    """The coaster of which nothing is wrong but what is hidden, the effect estimated from a wrong size on."""
    record = hidden_record(
        "coaster", seed=seed, batches=4, samples=150, weather=WEATHER, effects=hidden or {},
        shoaling=key.startswith("shallow"),
    )  # fmt: skip
    ship = extended_model(vessel_of("coaster"), record)
    ship = replace(ship.with_effects({key: LARGE[key]}), stated={key: LARGE[key]})
    windows = cut_windows(ship.model, record)
    return fit(ship, windows, (key,), starts=initial_states(windows))


def test_every_kind_that_begins_at_zero_is_walked():
    kinds = {kind for kind, row in EFFECTS.items() if row.low == 0.0}
    assert kinds == {*FROM_ZERO} == {key.split(":")[0] for key in LARGE}
    assert {"actuator_lag", "actuator_delay", "actuator_slew"} <= {cause.name for cause in CAUSES}


def share_held(key: str, seeds: range, hidden: dict | None, truth: float) -> tuple[int, list[float]]:
    found = [with_profiled_error(fitted(key, seed, hidden), key, NOISE_ALONE) for seed in seeds]
    stds = [one.std(key) for one in found]
    held = sum(abs(one.value(key) - truth) <= 1.96 * std for one, std in zip(found, stds, strict=True))
    return held, stds


@pytest.mark.thorough
@pytest.mark.parametrize("key", [key for key in LARGE if not key.startswith("deadband")])
def test_two_standard_errors_hold_a_size_of_zero(key):
    """Nothing acts, in 8 trials; widths of dead bands are found by trying values, with an error of their own."""
    held, stds = share_held(key, range(40, 48), None, 0.0)
    assert held >= binom.ppf(0.001, 8, 0.95)
    assert min(stds) > 0.0
    assert max(stds) < LARGE[key] / 3  # and still tell it from what shows


@pytest.mark.thorough
@pytest.mark.parametrize("key", SMALL)
def test_two_standard_errors_hold_a_small_size(key):
    hidden, truth = SMALL[key]
    held, _ = share_held(key, range(60, 68), hidden, truth)
    assert held >= binom.ppf(0.001, 8, 0.95)


def test_where_several_values_are_as_good_all_are_held():
    """A slew time too short for any recorded change to show has no slope, whatever the curvature says."""
    found = fitted("slew:rudder", 3)
    blind = replace(found, covariance=np.array([[1e-14]]))
    honest = with_profiled_error(blind, "slew:rudder", NOISE_ALONE)
    assert honest.std("slew:rudder") > 1e-3
    assert honest.value("slew:rudder") == found.value("slew:rudder")


def test_a_parabola_keeps_its_standard_error():
    found = fitted("delay:all", 4, {"delay_s": 2.5, "acts_on": 0b11})
    assert with_profiled_error(found, "delay:all", NOISE_ALONE).std("delay:all") == found.std("delay:all")


def test_a_size_that_may_be_zero_is_told_as_a_limit():
    assert from_zero(0.1, 0.2) == "at most 0.5"
    assert from_zero(1.0, 0.2) == "1.00 \N{PLUS-MINUS SIGN} 0.20"
    slew = next(cause for cause in CAUSES if cause.name == "actuator_slew")
    pairs = ((0.0, 0.0), (0.0, 0.5), (2.0, 0.1), (0.0, np.inf))
    words = [slew.explain({"slew:rudder": pair}, None) for pair in pairs]  # type: ignore[arg-type]
    assert [text.partition("inputs ")[2].partition(",")[0].rstrip(".") for text in words] == [
        "follow them at once", "follow them at once", "move at 0.500 \N{PLUS-MINUS SIGN} 0.025 per second",
        "follow them at once",
    ]  # fmt: skip
    assert "1 per second or more" in words[1]


@pytest.mark.parametrize("slew", [0.0, 1e-6, 2.0])
def test_a_rudder_found_to_follow_at_once_is_written_without_a_rate(slew):
    """Nor with the standard deviation of one: a vessel refuses that."""
    ship = vessel_of("coaster")
    actuators = tuple(
        replace(one, responses=tuple(replace(own, rate=0.05) for own in one.responses)) if one.kind == "rudder" else one
        for one in ship.actuators
    )
    stated = replace(ship, model=replace(ship.model, actuators=actuators), std={"rudder1_rate": 0.01})
    record = hidden_record("coaster", seed=1, batches=1, samples=20)
    found = extended_model(stated, record).with_effects({"slew:rudder": slew})
    written, _ = extend(stated, found, {"slew:rudder": 0.4})
    rate = written.actuators[1].responses[0].rate
    assert rate == (0.5 if slew > 1.0 else np.inf)
    assert written.std == ({"rudder1_rate": pytest.approx(0.4 / slew**2)} if slew > 1.0 else {})
