"""Standard trials: commands within limits that give the motion again, orders at the right headings, any vessel."""

import math
from dataclasses import replace

import numpy as np
import pytest

from expdesign.errors import InputError, NoAnswer
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import (
    Conduct,
    pull_out,
    simulate,
    steady_ahead,
    stopping,
    turning_circle,
    zigzag,
)
from expdesign.vessel import Response
from helm_case import ahead_only
from measured_trials import MODEL_SHIP_TRUE, TUG_TRUE
from nomoto_ship import GAIN, LAG, nomoto_ship

TEN, TWENTY = math.radians(10), math.radians(20)
SHIPS = {
    "rudder": nomoto_ship(),
    "azimuth": TUG_TRUE,
    "azimuth ahead only": ahead_only(TUG_TRUE),
    "force": MODEL_SHIP_TRUE,
}
TRIALS = {
    "circle": turning_circle,
    "zigzag": lambda ship, **how: zigzag(ship, heading_rad=TWENTY, helm_rad=TWENTY, **how),
    "pull-out": pull_out,
    "stopping": lambda ship, side="port", **how: stopping(ship, **how),
}


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize("kind", SHIPS)
def test_commands_keep_limits_and_rates_and_give_the_motion_again(kind: str, trial: str) -> None:
    ship = SHIPS[kind]
    start = steady_ahead(ship)
    commands, motion = TRIALS[trial](ship, conduct=Conduct(approach_s=3 * ship.sample_time_s))
    assert np.array_equal(commands.values[:3], np.tile(start.inputs, (3, 1)))
    steps = np.diff(commands.values, axis=0) / commands.sample_time_s
    for column, limit in enumerate(ship.limits):
        values = commands.values[:, column]
        slack = 1e-9 * max(1.0, np.abs(values).max())
        assert limit.low - slack <= values.min() <= values.max() <= limit.high + slack
        assert np.abs(steps[:, column]).max() <= ship.rates[column] * (1 + 1e-9) + slack
    again = simulate(ship, commands, velocity=start.velocity)
    assert np.allclose(again.pose, motion.pose, rtol=0, atol=1e-12)


@pytest.mark.parametrize("trial", TRIALS)
def test_slow_late_and_crooked_actuators_are_sailed_as_simulated(trial: str) -> None:
    """Lag, dead time, dead band and misalignment: the helmsman sees the motion that `simulate` gives."""
    plain = nomoto_ship()
    propeller, rudder = plain.actuators
    slow = (
        replace(propeller, responses=(Response(lag_s=3.0, delay_s=0.7),)),
        replace(rudder, responses=(Response(lag_s=1.5, delay_s=1.2, deadband=0.01, offset=0.02),)),
    )
    ship = replace(plain, model=replace(plain.model, actuators=slow))
    start = steady_ahead(ship, 6.5)
    assert start.angle_rad == pytest.approx(-0.02)
    commands, motion = TRIALS[trial](ship, conduct=Conduct(speed_mps=6.5, approach_s=5.0))
    again = simulate(ship, commands, velocity=start.velocity)
    assert np.allclose(again.pose, motion.pose, rtol=0, atol=1e-9)
    assert np.abs(motion.velocity[:10] - start.velocity).max() < 1e-9


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("side", ["starboard", "port"])
def test_the_ship_turns_to_the_side_asked_for_whatever_the_sign_of_its_rudder(side: str, sense: float) -> None:
    turn = 1 if side == "starboard" else -1
    _, motion = turning_circle(nomoto_ship(sense=sense), helm_rad=TWENTY, side=side)
    assert motion.pose[-1, 2] * turn == pytest.approx(3 * math.pi, abs=0.02)


@pytest.mark.parametrize("kind", SHIPS)
def test_the_approach_is_steady(kind: str) -> None:
    ship = SHIPS[kind]
    start = steady_ahead(ship, 0.8)
    held = Commands(sample_time_s=ship.sample_time_s, names=ship.model.inputs, values=np.tile(start.inputs, (50, 1)))
    motion = simulate(ship, held, velocity=start.velocity)
    assert np.allclose(motion.velocity, start.velocity, atol=1e-8)


def test_a_ship_with_a_neutral_helm_angle_is_held_straight_and_zigzags_about_it() -> None:
    ship = nomoto_ship(bias=0.03)
    assert steady_ahead(ship, 7.0).angle_rad == pytest.approx(-0.03)
    commands, _ = zigzag(ship, heading_rad=TEN, helm_rad=TEN)
    rudder = commands.column("rudder1")
    assert (rudder.min(), rudder.max()) == pytest.approx((-0.03 - TEN, -0.03 + TEN))


def overshoot(trial: tuple[Commands, Trajectory], heading_rad: float) -> float:
    """First overshoot [rad] of a zig-zag to starboard, the peak read off a parabola."""
    heading = trial[1].pose[:, 2]
    top = int(np.argmax(heading))
    before, at, after = heading[top - 1 : top + 2]
    return float(at + (after - before) ** 2 / (8 * (2 * at - before - after)) - heading_rad)


def test_results_do_not_hang_on_where_samples_fall() -> None:
    """Orders fall between samples: a coarse sampling differs from a fine one by its square, not by itself."""
    fine = overshoot(zigzag(nomoto_ship(sample_time_s=0.05), heading_rad=TEN, helm_rad=TEN), TEN)
    for step in (1.0, 1.3, 2.0):
        coarse = overshoot(zigzag(nomoto_ship(sample_time_s=step), heading_rad=TEN, helm_rad=TEN), TEN)
        late = 0.5 * GAIN * TEN * step  # what half a sample's delay of the order would do
        assert abs(coarse - fine) < 0.1 * late


def test_results_change_evenly_with_the_parameters() -> None:
    """No jumps: second differences over a ladder of parameter values are small beside first ones."""
    ship = nomoto_ship(sample_time_s=1.0)
    ladder = [
        overshoot(
            zigzag(
                replace(ship, model=ship.model.with_parameters({"N_r": -1 / LAG * factor})),
                heading_rad=TEN,
                helm_rad=TEN,
            ),
            TEN,
        )
        for factor in np.linspace(0.9, 1.1, 17)
    ]
    steps = np.diff(ladder)
    assert np.abs(np.diff(steps)).max() < 0.2 * np.abs(steps).mean()


def test_a_fixed_duration_is_kept_to_the_sample() -> None:
    for trial in TRIALS.values():
        commands, _ = trial(nomoto_ship(), conduct=Conduct(duration_s=200.0))
        assert commands.duration_s == pytest.approx(200.0)


def test_what_cannot_be_done_is_said_in_one_line() -> None:
    ship, coarse = nomoto_ship(), nomoto_ship(sample_time_s=4.0)
    with pytest.raises(InputError, match=r"helm of 41 deg needs rudder1 = .*expected -0.7 to 0.7"):
        turning_circle(nomoto_ship(sense=1.0), helm_rad=math.radians(41))
    with pytest.raises(InputError, match=r"cannot hold 12 m/s: it loses .* at full ahead"):
        steady_ahead(ship, 12.0)
    with pytest.raises(InputError, match="does not turn it"):
        turning_circle(replace(ship, model=ship.model.with_parameters({"N_d": 0.0})))
    with pytest.raises(InputError, match="side 'left'"):
        turning_circle(ship, side="left")
    with pytest.raises(NoAnswer, match="does not come to the end"):
        turning_circle(replace(coarse, model=coarse.model.with_parameters({"N_d": 1e-9})))
