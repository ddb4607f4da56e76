"""What the vessel file states of actuators and sensors is undone before parameters are estimated."""

import re
from dataclasses import replace

import numpy as np
import pytest

from estimation_case import MERGED, NOMINAL, TRUE
from expdesign.errors import InputError
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.regression.nuisance import unbiased_value
from expdesign.estimation.replay import Integration
from expdesign.reduction import at_reference_point, reduced, with_delivered_inputs, with_reduced_wind
from expdesign.reduction.sensors import readings
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands, Record
from expdesign.simulation import CALM, Environment, deliver, measure, simulate, simulate_ensemble
from expdesign.simulation.run import SUBSTEPS
from expdesign.vessel import SCALAR, Response, Sensors, Vessel, response_values, std_keys
from expdesign.vessel.quantities import GAINS_AND_OFFSETS
from expdesign.vessel.structures import parse_expression
from measured_trials import tug_commands
from scenario_files import SCENARIOS

WIND = Environment(wind_to=np.array([4.0, -3.0]))
COMMANDS = tug_commands(400)
TIMED = {"wind_delay_s": 2.0, "wind_interval_s": 3.0}
TWICE = {"velocity_delay_s": 2.0, "velocity_interval_s": 2.0}


def ship(*responses: Response, **sensors: object) -> Vessel:
    """The 30 m ship without noise, stating responses of each thruster's speed and angle, and faults of its sensors."""
    actuators = tuple(replace(one, responses=responses) for one in TRUE.model.actuators)
    return replace(TRUE, model=replace(TRUE.model, actuators=actuators), sensors=Sensors(**sensors))


LAG = Response(lag_s=3.0), Response(lag_s=2.0)
FAULTS = {
    "slew rate": ship(Response(rate=0.5), Response(rate=0.1)),
    "lag": ship(*LAG),
    "dead time": ship(Response(delay_s=2.0), Response(delay_s=1.3)),
    "dead band and offset": ship(Response(), Response(deadband=0.5, offset=0.05)),
    "place of the log": ship(velocity_forward_m=6.0, velocity_starboard_m=2.0),
    "axes of the log": ship(velocity_angle_rad=0.05),
    "scale and bias": ship(yaw_rate_scale=1.1, heading_bias_rad=0.1),
    "scale of the log": ship(velocity_scale=0.9, velocity_angle_rad=0.05, velocity_forward_m=6.0),
    **{fault.key: ship(**{fault.key: fault.neutral + 5 * fault.matters}) for fault in GAINS_AND_OFFSETS},
    "late log": ship(velocity_delay_s=2.0),
    "late gyro": ship(yaw_rate_delay_s=1.0, velocity_forward_m=6.0),
    "wind": ship(wind_forward_m=8.0, wind_starboard_m=-1.0, wind_axis_rad=0.2, heading_delay_s=1.0, **TIMED),
}
HELD = ship(*LAG, yaw_rate_interval_s=2.0, **TWICE)
ALL = ship(
    Response(rate=0.5, lag_s=3.0, delay_s=1.0), Response(rate=0.1, lag_s=2.0, deadband=0.3, offset=0.03),
    heading_bias_rad=0.05, velocity_angle_rad=0.05, yaw_rate_scale=1.1, yaw_rate_bias_radps=0.01,
    position_forward_m=5.0, position_starboard_m=-1.5, position_delay_s=1.0, heading_delay_s=1.0,
    velocity_forward_m=6.0, velocity_starboard_m=2.0, yaw_rate_delay_s=1.0, wind_forward_m=8.0, wind_axis_rad=0.2,
    **TIMED, **TWICE,
)  # fmt: skip


def sailed(
    vessel: Vessel, *, weather: Environment = CALM, integrator: str = "rk4", commands: Commands = COMMANDS
) -> Batch:
    """One run of a vessel as her sensors measure it."""
    how = {"integrator": "euler", "substeps": 1} if integrator == "euler" else {}
    motion = simulate(vessel, commands, velocity=(1.7, 0.7, 0.0), environment=weather, **how)
    seen = measure(vessel, commands, motion, environment=weather, rng=np.random.default_rng(0))
    pose = np.stack([seen["north_m"], seen["east_m"], np.unwrap(seen["heading_rad"])], axis=1)
    return Batch(
        name="run", sample_time_s=commands.sample_time_s, input_names=commands.names, inputs=commands.values,
        velocity=np.stack([seen["u_mps"], seen["v_mps"], seen["r_radps"]], axis=1), pose=pose,
        wind=np.stack([seen["wind_u_mps"], seen["wind_v_mps"]], axis=1),
    )  # fmt: skip


def largest_error(batch: Batch, vessel: Vessel, method: str, settings: Settings) -> float:
    """Of a parameter, relative to the truth."""
    found = estimate(reduced(Record(batches=(batch,)), vessel), NOMINAL, method=method, settings=settings)
    values = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
    merged = {name: values[MERGED[name]] for name in MERGED if MERGED[name] not in found.names}
    truth = np.array([values[name] + merged.get(name, 0.0) for name in found.names])
    return float(np.abs(found.values / truth - 1.0).max())


CONTINUOUS = Settings(integration=Integration("rk4", SUBSTEPS), quadrature="trapezoid")


@pytest.mark.parametrize("fault", [*FAULTS, "held", "all"])
def test_output_error_finds_every_parameter_exactly(fault: str):
    vessel = {**FAULTS, "held": HELD, "all": ALL}[fault]
    assert largest_error(sailed(vessel), vessel, "oe", CONTINUOUS) < 1e-6


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("method", ["ls-air", "iv-air"])
def test_regressions_in_wind_find_every_parameter_exactly(fault: str, method: str):
    """Euler's map, for which regressions are exact: a fault that is undone leaves no error in any row."""
    batch = sailed(FAULTS[fault], weather=WIND, integrator="euler")
    assert largest_error(batch, FAULTS[fault], method, Settings()) < 1e-6


@pytest.mark.parametrize("method", ["ls", "iv"])
@pytest.mark.parametrize("vessel", [HELD, ALL], ids=["held", "all"])
def test_regressions_from_readings_that_are_held_are_right_within_one_per_cent(method: str, vessel: Vessel):
    """Regressors between readings are interpolated, which leaves an error of their second differences."""
    batch = sailed(vessel, integrator="euler", commands=tug_commands(2000))
    assert largest_error(batch, vessel, method, Settings()) < 0.01


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["ls", "iv"])
def test_regressions_of_continuous_motion_are_as_good_as_without_faults(method: str):
    """The trapezoidal rule leaves an error of its own, which depends on the motion; faults add less than 1 %."""
    commands = tug_commands(2000)
    without = largest_error(sailed(ship(), commands=commands), ship(), method, CONTINUOUS)
    for fault, vessel in {**FAULTS, "held": HELD, "all": ALL}.items():
        assert largest_error(sailed(vessel, commands=commands), vessel, method, CONTINUOUS) < without + 0.01, fault


def test_what_actuators_deliver_has_the_mean_of_its_parts():
    (batch,) = reduced(Record(batches=(sailed(ALL),)), ALL).batches
    assert batch.delivered is not None
    np.testing.assert_allclose(batch.delivered.mean, batch.inputs, rtol=1e-12)


def test_what_is_not_stated_is_not_touched():
    record = Record(batches=(sailed(ship()),))
    assert reduced(record, ship()) is record


def test_whatever_a_vessel_file_may_state_of_actuators_and_sensors_is_among_these_faults():
    ships = (*FAULTS.values(), HELD, ALL)
    stated = {quantity(name) for one in ships for name in std_keys(one.actuators) if states(one, name)}
    assert {quantity(name) for name in std_keys(TRUE.actuators)} - stated == set()


def quantity(name: str) -> str:
    """What a key of `std_keys` is about, without the number of its signal."""
    return re.sub(r"^[na]\d+_", "", name)


def states(vessel: Vessel, name: str) -> bool:
    """Whether a vessel differs from one that states nothing, in a quantity of `std_keys`."""
    plain, own = ship(), response_values(vessel.actuators)
    if name in own:
        return own[name] != response_values(plain.actuators)[name]
    return getattr(vessel.sensors, name) != getattr(plain.sensors, name)


def test_positions_that_were_measured_act_as_they_are():
    """Beside rates, lags and dead times, which only commands pass through, a misalignment acts on positions too."""
    slow = ship(Response(rate=0.5, lag_s=3.0), Response(rate=0.1, delay_s=2.0, offset=0.03))
    batch = sailed(slow)
    given = deliver(slow.responses, batch.inputs, sample_time_s=1.0)
    reached = given.mean(axis=1) - [response.offset for response in slow.responses]
    told = replace(batch, inputs=reached, reached=batch.input_names)
    (seen,) = reduced(Record(batches=(told,)), slow).batches
    np.testing.assert_allclose(seen.inputs, given.mean(axis=1), atol=1e-12)


@pytest.mark.parametrize(
    ("speed", "still"),
    [
        (Response(rate=0.5), False),
        (Response(rate=0.5, offset=0.1), False),
        (Response(rate=0.5, lag_s=3.0), True),
        (Response(rate=0.5, delay_s=1.0), True),
        (Response(rate=0.5, deadband=0.2), True),
    ],
)
def test_what_a_recorded_input_is_taken_for_is_told_of_those_that_move(speed: Response, still: bool):
    slow = ship(speed, Response(rate=0.1))
    batch = sailed(slow)
    inputs = np.array(batch.inputs)
    inputs[:, 0] = 4.0 + np.sin(0.05 * np.arange(len(inputs)))  # n1, smooth
    inputs[:, 1:] = (0.3, 2.0, 0.3)  # never moved
    told = reduced(Record(batches=(replace(batch, inputs=inputs),)), slow).notes
    (taken,) = [note for note in told if "is taken for the" in note]
    assert taken.startswith("n1_rps changes no faster than 0.5 rps2, the stated rate, and is taken for the position")
    assert ("; dead times, lags and dead bands still act." in taken) == still


def test_inputs_that_follow_at_one_rate_are_told_in_one_note():
    slow = ship(Response(rate=0.5), Response(rate=0.1))
    told = [note for note in reduced(Record(batches=(sailed(slow),)), slow).notes if "followed at" in note]
    assert told == [
        "n1_rps and n2_rps are taken for commands; they are followed at 0.5 rps2, as the vessel file states.",
        "a1_rad and a2_rad are taken for commands; they are followed at 0.1 radps, as the vessel file states.",
    ]


def test_a_signal_between_readings_is_within_the_stated_error():
    """3/128 h**4 max|d4x/dt4| inside, 1/24 of it at the ends, for a delay that is no whole number of samples."""
    for omega, delay, interval in ((0.3, 0.5, 0.0), (0.2, 2.3, 0.0), (0.1, 1.7, 3.0), (0.1, 0.0, 2.5)):
        taken = np.arange(400.0) - delay
        if interval:
            taken = np.floor(taken / interval + 1e-9) * interval
        found, as_stated = readings(np.sin(omega * taken)[:, None], (delay, interval), sample_time_s=1.0)
        assert as_stated
        grid = np.arange(10.0, 390.0)
        bound = 3 / 128 * (omega * max(interval, 1.0)) ** 4
        error = np.abs(found.at(grid)[:, 0] - np.sin(omega * grid))
        assert error.max() <= bound * (1 + 1e-9)
        assert error.max() > bound / 3  # the bound is close


@pytest.mark.parametrize("first", [0, 1, 2, 3, 4])
def test_the_time_of_the_readings_is_found_wherever_the_data_begin(first: int):
    time = np.arange(first, 200.0)
    shown = np.floor((time - 1.0) / 5.0) * 5.0  # taken every 5 samples, 1 late
    found, as_stated = readings(np.cos(0.01 * shown)[:, None], (1.0, 5.0), sample_time_s=1.0)
    assert as_stated
    np.testing.assert_allclose(found.values[:, 0], np.cos(0.01 * (first + found.times)), atol=1e-12)


def test_a_signal_that_is_not_held_as_stated_counts_as_read_at_every_sample():
    values = np.random.default_rng(0).standard_normal((100, 1))
    found, as_stated = readings(values, (0.0, 4.0), sample_time_s=1.0)
    assert not as_stated
    np.testing.assert_array_equal(found.at(np.arange(100.0)), values)


def test_velocities_from_the_pose_are_of_the_reference_point():
    """Differences of the antenna's pose, turned by a compass with a bias, against differences of the ship's own."""
    faulty = ship(position_forward_m=5.0, position_delay_s=2.0, heading_delay_s=2.0, heading_bias_rad=0.1)
    one, other = (from_pose(sailed(vessel)) for vessel in (faulty, ship()))
    seen = reduced(Record(batches=(one,)), faulty).batches[0]
    np.testing.assert_allclose(seen.velocity, other.velocity[1 : 1 + len(seen)], atol=1e-9)
    np.testing.assert_allclose(seen.pose, other.pose[1 : 1 + len(seen)], atol=1e-9)


@pytest.mark.parametrize("missing", [1, 2, 3])
def test_first_rows_without_a_position_change_no_velocity_after_them(missing: int):
    faulty = ship(position_forward_m=5.0, heading_bias_rad=0.1)
    whole = from_pose(sailed(faulty))
    assert whole.pose is not None
    begun_late = replace(whole, pose=np.where(np.arange(len(whole))[:, None] < missing, np.nan, whole.pose))
    full, late = (reduced(Record(batches=(one,)), faulty).batches[0] for one in (whole, begun_late))
    known = np.isfinite(late.velocity).all(axis=1)
    assert len(late) - known.sum() <= missing + 2
    np.testing.assert_array_equal(late.velocity[known], full.velocity[-len(late) :][known])


def test_velocities_from_a_pose_that_stands_are_not_derived_anew():
    """They may have been derived otherwise, by a filter for example."""
    stated = ship(yaw_rate_scale=1.1, wind_forward_m=8.0)
    batch = from_pose(sailed(ship()))
    filtered = replace(batch, velocity=0.9 * batch.velocity)
    (seen,) = reduced(Record(batches=(filtered,)), stated).batches
    np.testing.assert_array_equal(seen.velocity, filtered.velocity)


def test_inputs_are_averaged_as_velocities_from_the_pose_are():
    """Otherwise the response to inputs seems weaker than it is."""
    batch = from_pose(sailed(ship(), commands=tug_commands(2000)))
    (seen,) = reduced(Record(batches=(batch,)), ship()).batches
    np.testing.assert_allclose(seen.inputs[1:-1], batch.inputs[:-2] / 4 + batch.inputs[1:-1] / 2 + batch.inputs[2:] / 4)
    truth = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
    found = [estimate(Record(batches=(one,)), NOMINAL, method="ls", settings=CONTINUOUS) for one in (seen, batch)]
    for name in ("Y_mu", "N_mu"):
        with_, without = (abs(item.assignments[name] / truth[name] - 1.0) for item in found)
        assert with_ < 0.7 * without, name


def from_pose(batch: Batch) -> Batch:
    from expdesign.records import central_difference

    assert batch.pose is not None
    return replace(
        batch, velocity=central_difference(batch.pose, batch.sample_time_s), pose=batch.pose[1:-1],
        inputs=batch.inputs[1:-1], wind=None, derived=("u", "v", "r"),
    )  # fmt: skip


def test_winds_for_a_diagnosis_give_the_air_over_ground():
    log = {"velocity_starboard_m": 0.0, "velocity_delay_s": 1.0, "velocity_interval_s": 0.0}
    vessel = replace(ALL, sensors=replace(ALL.sensors, **log))
    batch = sailed(vessel, weather=WIND)
    seen = with_reduced_wind(Record(batches=(batch,)), vessel.sensors).batches[0]
    np.testing.assert_array_equal(seen.velocity, batch.velocity)
    air = seen.velocity[:, :2] - seen.wind
    known = np.isfinite(air).all(axis=1)
    assert known.mean() > 0.95
    np.testing.assert_allclose(np.hypot(*air[known].T), 5.0, rtol=1e-9)


def test_remarks_say_what_was_undone():
    record = reduced(Record(batches=(sailed(ALL, weather=WIND),)), ALL)
    for words in (
        "commands of n1, a1, n2, a2 act", "positions are 1 s late", "velocities are measured 6 m forward and 2 m to",
        "velocities are 2 s late; they are moved to their own time, and velocities are read every 2 s",
        "0.05 rad is taken off the headings", "axes 0.05 rad to starboard", "the yaw rate is divided by 1.1",
        "winds are measured 8 m forward", "winds are measured along axes 0.2 rad to starboard; they are turned",
    ):  # fmt: skip
        assert sum(words in note for note in record.notes) == 1, words


def test_delays_longer_than_the_data_are_refused():
    late = Sensors(velocity_delay_s=500.0)
    with pytest.raises(InputError, match="no batch is longer than the delays"):
        at_reference_point(Record(batches=(sailed(TRUE),)), late)


@pytest.mark.parametrize("text", ["v_q", "u_q*v_q", "abs(u_q)*u_q", "abs(u_q)*v_q", "u*abs(v_q)", "u*v"])
def test_terms_of_a_vanes_wind_are_right_on_average_over_its_noise(text: str):
    """By Gauss and Hermite's quadrature over the noise, while nothing in a modulus changes its sign."""
    std, speed, angle = 0.1, 7.0, 0.8
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    seen = angle + std * nodes
    shrunk = np.exp(-(std**2) / 2)
    signals = {"u": np.full(9, 2.0), "v": np.full(9, 0.5)}
    table = signals | {"u_q": speed * np.cos(seen) / shrunk, "v_q": speed * np.sin(seen) / shrunk}
    expression = parse_expression(text, signals=("u", "v", "u_q", "v_q"))
    mean = np.broadcast_to(unbiased_value(expression, table, std), 9) @ weights / weights.sum()
    exact = {"u": 2.0, "v": 0.5, "u_q": speed * np.cos(angle), "v_q": speed * np.sin(angle)}
    assert mean == pytest.approx(expression.evaluate(exact, SCALAR), rel=1e-9)


@pytest.mark.thorough
def test_instruments_find_wind_forces_from_a_noisy_vane():
    """On average over trials, which without the correction they do not."""
    vessel, trials = ship(wind_sensor="vane", wind_angle_rad=0.3), 10
    inputs = np.stack([tug_commands(1500, seed=seed).values for seed in range(trials)], axis=1)
    many = simulate_ensemble(
        vessel, inputs, runs=trials, environment=WIND, rng=np.random.default_rng(1), velocity=(1.7, 0.7, 0.0)
    )
    place, ratios = NOMINAL.names.index("W_uv"), {True: [], False: []}
    for trial in range(trials):
        measured = Record(batches=(many.batch(trial),))
        for told, values in ratios.items():
            found = estimate(reduced(measured, vessel) if told else measured, NOMINAL, method="iv-air")
            values.append(found.values[found.names.index("W_uv")] / TRUE.model.parameters[place] - 1.0)
    for told, values in ratios.items():
        error = abs(np.mean(values)) / (np.std(values, ddof=1) / np.sqrt(trials))
        assert error < 4 if told else error > 8


def test_least_squares_takes_the_wind_as_a_noisy_vane_measures_it():
    """What a correction of the mean enlarges is noise too, by which least squares is drawn towards zero."""
    vessel = ship(wind_sensor="vane", wind_angle_rad=0.5)
    many = simulate_ensemble(
        vessel, tug_commands(600).values, runs=1, environment=WIND, rng=np.random.default_rng(2), velocity=(1.7, 0.7, 0)
    )
    raw = Record(batches=(many.batch(0),))
    told, untold = (estimate(record, NOMINAL, method="ls-air") for record in (reduced(raw, vessel), raw))
    np.testing.assert_allclose(told.values, untold.values, rtol=1e-9)
    assert any("0.5 rad draws least squares towards zero" in warning for warning in told.warnings)
    assert not untold.warnings


@pytest.mark.parametrize("method", ["ls-air", "iv-air"])
def test_a_stated_wind_stands_for_one_that_is_not_measured(method: str):
    vessel = replace(ship(), environment=WIND)
    batch = replace(sailed(vessel, weather=WIND, integrator="euler"), wind=None)
    assert any("No wind is measured" in note for note in reduced(Record(batches=(batch,)), vessel).notes)
    assert largest_error(batch, vessel, method, Settings()) < 1e-6


def test_a_stated_current_is_said_not_to_be_taken_off():
    vessel = replace(ship(), environment=Environment(current_to=np.array([0.2, 0.0])))
    (note,) = reduced(Record(batches=(sailed(ship()),)), vessel).notes
    assert "is not taken off" in note


NOISE = {"velocity_mps": 0.03, "yaw_rate_radps": 0.002}


def coverage(vessel: Vessel, *, trials: int, seed: int) -> np.ndarray:
    """(t,) share of parameters whose interval of 95 % holds the truth, in each trial of 600 s."""
    rng = np.random.default_rng(seed)
    inputs = np.stack([tug_commands(600, seed=seed + trial).values for trial in range(trials)], axis=1)
    many = simulate_ensemble(vessel, inputs, runs=trials, environment=CALM, rng=rng, velocity=(1.7, 0.7, 0.0))
    held = []
    for trial in range(trials):
        found = estimate(reduced(Record(batches=(many.batch(trial),)), vessel), TRUE.model, method="iv")
        values = dict(zip(TRUE.model.names, TRUE.model.parameters.tolist(), strict=True))
        truth = [values[name] + (values[MERGED[name]] if name in MERGED else 0.0) for name in found.names]
        held.append(np.mean(np.abs(found.values - truth) < 1.96 * found.std))
    return np.array(held)


def check_coverage(trials: int) -> None:
    """With every fault as without any: the difference is within four of its standard errors over trials."""
    sensors = replace(ALL.sensors, **NOISE)
    faulty, faultless = (
        coverage(vessel, trials=trials, seed=7)
        for vessel in (replace(ALL, sensors=sensors), ship(*ALL.responses[:2], **NOISE))
    )
    error = np.hypot(faulty.std(ddof=1), faultless.std(ddof=1)) / np.sqrt(trials)
    assert abs(faulty.mean() - faultless.mean()) < 4 * error
    assert faulty.mean() > 0.8


@pytest.mark.thorough
def test_intervals_cover_as_often_as_without_faults():
    check_coverage(8)


@pytest.mark.slow
def test_intervals_cover_as_often_as_without_faults_in_many_trials():
    check_coverage(150)


@pytest.mark.parametrize("reached_in", [(), (0,), (1,), (0, 1)])
def test_notes_on_positions_and_commands_count_every_run(reached_in: tuple[int, ...]) -> None:
    """They went by the first run: a command in the second was called measured, or a position followed at its rate."""
    coaster = load_vessel(SCENARIOS / "vessels/coaster-80m.toml")
    order = np.where(np.arange(120) // 40 % 2, 0.3, -0.3)
    inputs = np.column_stack([np.full(120, 2.0), order])
    batches = tuple(
        Batch(
            name=f"run {k}", sample_time_s=1.0, input_names=("n1", "rudder1"), inputs=inputs,
            velocity=np.ones((120, 3)), reached=("rudder1",) if k in reached_in else (),
        )
        for k in range(2)
    )  # fmt: skip
    notes = "\n".join(with_delivered_inputs(Record(batches=batches), coaster.model).notes)
    count = len(reached_in)
    assert ("reached_rudder1_rad is used as measured" in notes) == (count > 0)
    assert ("reached_rudder1_rad is used as measured in 1 of 2 batches" in notes) == (count == 1)
    assert ("rudder1_rad is taken for the command" in notes) == (count < 2)
