from dataclasses import replace

import numpy as np
import pytest

from expdesign.dictionary import build_dictionary
from expdesign.errors import NotInformative
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.processes import local_processes
from expdesign.rehearsal import validation
from expdesign.rehearsal.validation import Rehearsal, heading_rad, trial_parts, validate
from expdesign.scenario import load_vessel
from expdesign.scenario.dictionaries import load_dictionary
from expdesign.signals import Commands
from expdesign.simulation import Environment, Variation
from expdesign.vessel import Actuator, Limit, Sensors, Term, Vessel, VesselModel
from scenario_files import SCENARIOS

TRUE = load_vessel(SCENARIOS / "vessels" / "model-ship-true.toml")
NOMINAL = load_vessel(SCENARIOS / "vessels" / "model-ship.toml")
QUIET = replace(TRUE, sensors=Sensors(velocity_mps=0.02, yaw_rate_radps=0.02))
PRIMITIVES = build_dictionary(NOMINAL, load_dictionary(SCENARIOS / "dictionaries" / "model-ship.toml"))
NAMES = TRUE.model.names
CURRENT = Environment(current_variation=Variation(std_mps=0.02))
RUNS = (1, 1, 0, 0, 1, 1, 0, 1, 0, 0, 1)


def surge_ship(damping: float, noise: float) -> Vessel:
    """u(k+1) = u(k) + X_u u(k) + tau: one parameter is estimated, the other known."""
    force = Actuator(kind="force", number=1, limits=(Limit(),) * 3)
    model = VesselModel(
        terms=(Term("u", "X_u", "u"), Term("u", "X_mu", "tau_x")),
        parameters=np.array([damping, 1.0]),
        parameter_std=np.zeros(2),
        form="discrete",
        sample_time_s=1.0,
        actuators=(force,),
    )
    return Vessel(
        name="surge",
        length_m=1.0,
        beam_m=0.3,
        draught_m=0.1,
        sample_time_s=1.0,
        model=model,
        sensors=Sensors(velocity_mps=noise),
    )


@pytest.mark.parametrize("mean", ["none", "complete"])
def test_one_parameter_has_a_closed_form(mean):
    a, noise, k = -0.2, 0.1, 60
    force = np.sin(0.3 * np.arange(k)) + 1.5
    commands = Commands(
        sample_time_s=1.0, names=("tau_x", "tau_y", "tau_psi"), values=np.column_stack([force, 0 * force, 0 * force])
    )
    u = np.zeros(k + 1)
    for step in range(k):
        u[step + 1] = u[step] + a * u[step] + force[step]
    z = u[:-1] - (u[:-1].mean() if mean == "complete" else 0.0)
    # sum z eps = sum over noise samples e(j) of (z(j-1) - (1 + a) z(j)) e(j)
    meets = np.r_[0.0, z] - (1 + a) * np.r_[z, 0.0]
    expected = noise**2 * (meets**2).sum() / (z @ u[:-1]) ** 2
    part = TrialPart(commands=commands, velocity=np.zeros(3))
    found = expected_covariance(surge_ship(a, noise), [part], ("X_u",), mean_subtraction=mean, integrator="euler")
    assert found[0, 0] == pytest.approx(expected, rel=1e-8)


def test_more_runs_and_less_noise_act_as_they_must():
    parts = trial_parts(PRIMITIVES, RUNS)
    once = expected_covariance(QUIET, parts, NAMES, environment=CURRENT)
    thrice = expected_covariance(QUIET, [replace(part, repeats=3) for part in parts], NAMES, environment=CURRENT)
    assert np.allclose(3 * thrice, once, rtol=1e-9)
    louder = replace(QUIET, sensors=Sensors(velocity_mps=0.06, yaw_rate_radps=0.06))
    strong = Environment(current_variation=Variation(std_mps=0.06))
    assert np.allclose(expected_covariance(louder, parts, NAMES, environment=strong), 9 * once, rtol=1e-9)
    assert (np.linalg.eigvalsh(once / np.sqrt(np.outer(np.diag(once), np.diag(once)))) > 0).all()


def test_repeats_are_the_same_as_parts_written_out():
    parts = trial_parts(PRIMITIVES, RUNS)
    twice = [replace(part, repeats=2) for part in parts]
    for mean in ("none", "batch", "complete"):
        written_out = expected_covariance(QUIET, [*parts, *parts], NAMES, mean_subtraction=mean)
        assert np.allclose(expected_covariance(QUIET, twice, NAMES, mean_subtraction=mean), written_out, rtol=1e-9)


def test_parameters_without_excitation_are_named():
    straight = trial_parts(PRIMITIVES, (1,) + (0,) * 10)
    with pytest.raises(NotInformative, match="Y_v"):
        expected_covariance(QUIET, straight, NAMES, mean_subtraction="none")


def rehearsed(integrator: str, trials: int) -> Rehearsal:
    return Rehearsal(
        truth=QUIET,
        nominal=NOMINAL,
        primitives=PRIMITIVES,
        designs={"mixed": RUNS},
        total_s=200.0,
        environment=CURRENT,
        parameters=NAMES,
        integrator=integrator,
        trials=trials,
    )


@pytest.mark.thorough
def test_parameters_of_continuous_motion_are_those_estimated_from_it():
    """The yaw damping, 0.35 per sample, is estimated without the 15 % that Euler's map would be off."""
    trials = 30
    rehearsal = rehearsed("rk4", trials)
    (result,) = validate(rehearsal)
    known = result.found / np.abs(result.truth) < 0.1
    assert known.sum() >= 6
    assert (np.abs(result.bias / result.truth)[known] < 0.02).all()
    assert (np.abs(result.found / result.theory - 1.0) < 0.15 + 2.8 / np.sqrt(2 * trials)).all()


@pytest.mark.thorough
@pytest.mark.parametrize("trials", [pytest.param(1000, marks=pytest.mark.slow), 30])
def test_predicted_standard_deviations_are_those_of_simulated_trials(trials):
    rehearsal = rehearsed("euler", trials)
    (result,) = validate(rehearsal)
    assert result.failed == 0
    ratio = result.found / result.theory
    # a standard deviation from n trials is known to 1 / sqrt(2 n); ten parameters share the chance
    allowed = 0.10 + 2.8 / np.sqrt(2 * trials)
    assert (np.abs(ratio - 1.0) < allowed).all(), dict(zip(NAMES, ratio.round(3), strict=True))


SHIP_30M = load_vessel(SCENARIOS / "vessels" / "azimuth-30m-true.toml")
FEW = (
    "acceleration",
    "zigzag-steep-speed-1",
    "turning-circle-starboard",
    "inward-spiral-speed-0.9",
    "telegraph-draw-1",
)


def ship_30m_rehearsal(trials: int, method: str, designs: tuple[str, ...] = ()) -> Rehearsal:
    """The 30 m ship in steady wind, true and nominal alike, with sensors so quiet that first order holds."""
    specs = load_dictionary(SCENARIOS / "dictionaries" / "standard.toml")
    primitives = build_dictionary(SHIP_30M, [spec for spec in specs if not designs or spec.name in designs])
    assert not designs or len(primitives) == len(designs)
    return Rehearsal(
        truth=replace(SHIP_30M, sensors=Sensors(velocity_mps=0.002, yaw_rate_radps=0.0005, wind_mps=0.005)),
        nominal=SHIP_30M,
        primitives=primitives,
        designs={"each once": (1,) * len(primitives)},
        total_s=1000.0,
        environment=Environment(wind_to=np.array([3.0, 2.0])),
        parameters=SHIP_30M.model.names,
        method=method,
        integrator="euler",
        trials=trials,
    )


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("trials", "designs"), [pytest.param(600, (), marks=pytest.mark.slow), (20, FEW)], ids=["dictionary", "few"]
)
def test_eighteen_parameters_in_measured_wind_are_as_uncertain_as_predicted(trials, designs):
    (result,) = validate(ship_30m_rehearsal(trials, "iv-air", designs))
    assert result.failed == 0
    # 18 parameters share the chance; a bias of half a standard deviation would count as inconsistent
    assert (np.abs(result.found / result.theory - 1.0) < 0.10 + 3.0 / np.sqrt(2 * trials)).all()
    assert (np.abs(result.bias) < (0.1 + 3.3 / np.sqrt(trials)) * result.found).all()


def test_headings_of_any_consecutive_runs_are_spread_evenly():
    headings = np.array([heading_rad(number) for number in range(60)])
    for first in range(0, 50, 7):
        part = np.exp(1j * headings[first : first + 8])
        # eight headings in one direction have the modulus 8, eight drawn at random 2.8
        assert abs(part.sum()) < 1.6


@pytest.mark.thorough
def test_any_number_of_processes_and_any_interruption_give_the_same(monkeypatch):
    monkeypatch.setattr(validation, "CHUNK_TRIALS", 3)
    monkeypatch.setattr(validation, "SINGLE_TRIALS", 2)
    rehearsal = Rehearsal(
        truth=QUIET,
        nominal=NOMINAL,
        primitives=PRIMITIVES,
        designs={"mixed": RUNS, "random": None},
        total_s=120.0,
        environment=CURRENT,
        parameters=NAMES,
        integrator="euler",
        trials=4,
    )
    kept: dict[str, np.ndarray] = {}
    whole = validate(rehearsal, keep=kept.__setitem__)
    half = {key: rows for key, rows in kept.items() if "/0-" in key}
    assert 0 < len(half) < len(kept)
    with local_processes(2):
        resumed = validate(rehearsal, done=half)
    for one, other in zip(whole, resumed, strict=True):
        assert np.array_equal(one.estimates, other.estimates)
        assert np.array_equal(one.stated, other.stated)
