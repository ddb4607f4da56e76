"""What is foreseen of a diagnosis holds in simulated trials, obeys identities, and agrees with closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from expdesign.diagnosis.motion import initial_states, stable_windows
from expdesign.diagnosis.select import fit_nuisance, score_tests
from expdesign.diagnosis.select.fitted_candidate import fit_candidate
from expdesign.diagnosis.select.score_tests import of_several
from expdesign.diagnosis.select.starting_point import starting_point
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.dictionary import build_dictionary
from expdesign.foresight import (
    background,
    design_runs,
    foresee,
    level_of,
    needed_noncentrality,
    power,
    simulated_record,
    weather_without_causes,
    with_effect,
)
from expdesign.foresight.effects import disturbance_at
from expdesign.foresight.information import SimulatedUnits, simulated_units
from expdesign.foresight.power import share_shown
from expdesign.scenario import load_scenario
from expdesign.vessel import Vessel
from scenario_files import SCENARIOS

STORY = SCENARIOS / "story.toml"
RUNS = {"zigzag-speed-1.4": 1, "sway-zigzag-sway-0.6": 1, "telegraph": 1}


@pytest.fixture(scope="module")
def case():
    """The tender, three runs of two minutes, the bay's weather."""
    scenario = load_scenario(STORY)
    primitives = build_dictionary(scenario.vessel, scenario.dictionary)
    runs = design_runs(primitives, [RUNS.get(item.name, 0) for item in primitives])
    return scenario.vessel, runs, scenario.environment


@pytest.fixture(scope="module")
def known(case):
    """The trial with nothing hidden."""
    return background(*case, seed=0)


@pytest.fixture(scope="module")
def foreseen(case):
    """Effects by name."""
    return {item.name: item for item in foresee(*case, seed=0).effects}


@pytest.fixture(scope="module")
def of_known_ship(case, foreseen):
    """The same sizes where parameters count as known."""
    vessel, runs, weather = case
    sizes = {item.cause: item.change for item in foreseen.values() if item.sized}
    return {item.name: item for item in foresee(certain(vessel), runs, weather, sizes=sizes, seed=0).effects}


def certain(vessel: Vessel) -> Vessel:
    """The vessel with parameters that count as known."""
    model = vessel.model
    return replace(vessel, model=replace(model, parameter_std=np.zeros_like(model.parameter_std)))


def drawn(vessel: Vessel, rng: np.random.Generator) -> Vessel:
    """The vessel with parameters as wrong as its file says they may be."""
    model = vessel.model
    values = model.parameters + model.parameter_std * rng.standard_normal(len(model.parameters))
    return replace(vessel, model=model.with_parameters(values))


def test_power_of_nothing_is_the_level_and_rises_with_the_size():
    for freedom in (1, 2, 5):
        for multiplicity in (1.0, 30.0, 500.0):
            level = level_of(multiplicity)
            assert of_several(level, multiplicity) == pytest.approx(0.025)
            curve = power(np.linspace(0.0, 60.0, 200), freedom, level)
            assert curve[0] == pytest.approx(level)
            assert (np.diff(curve) > 0).all()
            for wanted in (0.5, 0.9):
                assert power(needed_noncentrality(wanted, freedom, level), freedom, level) == pytest.approx(wanted)
    two_sided = ncx2.sf(chi2.isf(0.025, 1), 1, 9.0)  # a number three standard errors from zero
    assert float(power(9.0, 1, 0.025)) == pytest.approx(two_sided)


@pytest.mark.thorough
def test_a_gyro_is_as_visible_as_its_own_readings_make_it(case, of_known_ship):
    """With a known ship the noise of the yaw rate alone hides a scale error: size squared times sum r^2 / sigma^2.

    A diagnosis uses a little less: it spends the first samples of a run on noise filters and its initial state, and
    takes 5 % more white noise than it finds.
    """
    vessel, runs, weather = case
    (found,) = (item for item in of_known_ship.values() if item.cause == "gyro_scale")
    std = vessel.sensors.yaw_rate_radps
    still = simulated_record(certain(vessel), runs, weather_without_causes(vessel, weather), np.random.default_rng(1))
    turned = sum(float((batch.velocity[:, 2] ** 2).sum()) - len(batch) * std**2 for batch in still.batches)
    expected = found.change**2 * turned / std**2
    assert 0.7 * expected < found.noncentrality < 1.05 * expected


@pytest.mark.thorough
def test_what_uncertain_parameters_imitate_is_harder_to_find(foreseen, of_known_ship):
    """A heavier ship looks like other damping and thrust; a sensor's place does not."""

    def kept(name: str) -> float:
        beside, alone = (item[name].noncentrality / item[name].change ** 2 for item in (foreseen, of_known_ship))
        return beside / alone

    assert kept("inertia_factor_u") < 0.3
    assert 0.5 < kept("forward_m") < 1.1


@pytest.mark.thorough
def test_a_heavier_ship_is_not_heavier_in_proportion(known, foreseen):
    """Twice the inertia halves the accelerations: by less than twice what a little more inertia takes, per unit."""
    item = foreseen["inertia_factor_u"]
    (direction,) = item.effect.directions
    linear = known.base.linear
    little, much = (disturbance_at(linear, direction, size).force[..., 0] / size for size in (1e-4, 1.0))
    assert np.abs(much).max() == pytest.approx(0.5 * np.abs(little).max(), rel=1e-3)


@pytest.mark.thorough
def test_a_lag_and_a_dead_time_are_not_told_apart_but_a_current_and_a_gyro_are(foreseen):
    lag = {item.cause: item for item in foreseen["lag_all_s"].confusions}
    assert lag["actuator_delay"].cosine > 0.95
    current = {item.cause: item for item in foreseen["north/east_mps"].confusions}
    assert current["gyro_scale"].cosine < 0.5
    assert current["gyro_scale"].told_apart > 0.9
    for item in foreseen.values():
        if item.sized:
            assert item.named <= item.found + 4 * np.sqrt(item.power * (1 - item.power) / 2000) + 1e-9


@pytest.mark.thorough
def test_held_out_runs_show_most_of_what_is_certain_and_never_more_than_the_test_accepts(foreseen):
    sized = [item for item in foreseen.values() if item.sized]
    assert all(0.0 <= item.found <= item.power for item in sized)
    assert foreseen["north/east_mps"].found == foreseen["north/east_mps"].power  # far more than any noise
    assert foreseen["velocity_angle_rad"].found == foreseen["velocity_angle_rad"].power
    assert foreseen["inertia_factor_r"].found < 0.9 * foreseen["inertia_factor_r"].power


def simulated(effect: float, *noises: float, count: int = 6) -> SimulatedUnits:
    """Units of 100 white samples of each output, an effect that acts evenly on all, records with errors of sizes."""
    one, samples = np.ones((count, 1, 1)), 100.0
    each = samples * np.square(noises)[:, None, None] * np.ones((count, 3))
    return SimulatedUnits(
        information=3.0 * samples * effect**2 * one, predicted=3.0 * samples * effect**2 * one, blocks=1,
        samples=np.full(count, 3.0 * samples), products=samples * effect**2 * np.ones((count, 3, 1, 1)),
        with_error=np.zeros((len(noises), count, 3, 1)), squared_error=each, squared_deviation=1e4 * np.ones_like(each),
        precision=np.zeros((0, 0)),
    )  # fmt: skip


def share(units: SimulatedUnits) -> float:
    return share_shown(units, np.array([0]), np.ones(1), 0.0, np.random.default_rng(0))


def test_held_out_runs_show_an_effect_as_large_as_the_noise_and_not_one_lost_in_it():
    """An effect of the noise's own size halves squared errors; one of a hundredth of it takes nothing off them."""
    assert share(simulated(1.0, 1.0)) == 1.0
    assert share(simulated(0.1, 1.0)) < 0.3
    assert share(simulated(0.1, 0.1)) > 0.9  # simulations as accurate as the effect is large


def test_what_is_found_does_not_hang_on_one_record():
    """Half of the trials have the errors of each of two records, one that shows the effect and one that hides it."""
    shown, hidden = share(simulated(0.1, 0.1)), share(simulated(0.1, 1.0))
    assert share(simulated(0.1, 0.1, 1.0)) == pytest.approx((shown + hidden) / 2, abs=3 * 0.5 / np.sqrt(60))


@pytest.mark.thorough
def test_predictions_of_surge_sway_and_yaw_rate_tell_less_than_these_with_the_heading(known, foreseen):
    """What is known beside initial states never falls with another channel; a heading tells of damping in yaw."""
    (direction,) = foreseen["factor"].effect.directions
    gyro = disturbance_at(known.base.linear, direction, 0.02)
    units = simulated_units(known.base, known.windows, known.again, [gyro])
    size = np.sqrt(np.diagonal(units.information, axis1=1, axis2=2))
    told = (units.information - units.predicted) / (size[:, :, None] * size[:, None, :])
    assert np.linalg.eigvalsh(told).min() > -1e-6
    place = known.base.keys.index("theta:N_r")
    assert (told[:, place, place] > 0.1).any()


def shares_found(case, known, found, wanted: float, trials: int) -> tuple[float, float]:
    """Foreseen and simulated share of trials in which the likelihood ratio test accepts an effect, at about a power."""
    vessel, runs, weather = case
    (direction,) = found.effect.directions
    least = needed_noncentrality(wanted, found.freedom, found.level)
    size = found.change * np.sqrt(least / found.noncentrality)  # of these effects the number in results is the effect
    effects = foresee(vessel, runs, weather, sizes={found.cause: size}).effects
    (there,) = [item for item in effects if (item.cause, item.name) == (found.cause, found.name)]
    calm, stated, hits = weather_without_causes(vessel, weather), known.base.ship.without_effects({*known.base.keys}), 0
    for trial in range(trials):
        rng = np.random.default_rng([3, trial])
        record = simulated_record(with_effect(drawn(vessel, rng), stated, direction, size), runs, calm, rng)
        ship = extended_model(vessel, record)
        windows = stable_windows(ship, record)
        base = fit_nuisance(ship, windows, initial_states(windows))
        (test,) = score_tests(base, [found.effect.candidate])
        fitted = fit_candidate(base, windows, starting_point(base, test))
        hits += fitted is not None and chi2.sf(fitted.likelihood_gain, found.freedom) <= found.level
    return there.power, hits / trials


TRIALS = 100
EFFECTS = ("inertia_factor_r", "velocity_angle_rad", "forward_m", "thrust_offset_m", "Y_abs_v_v", "lag_all_s")


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_the_test_finds_as_often_as_foreseen(case, known, foreseen, name):
    """Within three standard errors of the binomial distribution, and eight points for the noise that is estimated."""
    predicted, found = shares_found(case, known, foreseen[name], 0.6, TRIALS)
    assert abs(predicted - 0.6) < 0.15  # sizes are scaled in proportion
    assert abs(found - predicted) < 3 * np.sqrt(predicted * (1 - predicted) / TRIALS) + 0.08
