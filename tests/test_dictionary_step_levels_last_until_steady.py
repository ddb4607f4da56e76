"""Levels of step trials last until most vessels of the prior are steady, and then for a circle; limits and shifts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from design_case import spec
from expdesign.dictionary import Primitive, PrimitiveSpec, build_primitive
from expdesign.dictionary.families.step_trials import SETTLED, hold_times, steady_turn
from expdesign.errors import InputError
from expdesign.scenario import load_vessel
from expdesign.simulation import Environment, simulate, steady_ahead
from expdesign.vessel import Vessel
from step_case import GUESS

SETTINGS = {"circle_s": 60.0, "steady_s": 10.0, "sure": 0.8}


def certain() -> Vessel:
    """The fast craft, its guessed model counted as known."""
    ship = load_vessel(GUESS)
    return replace(ship, model=replace(ship.model, parameter_std=0.0 * ship.model.parameter_std))


def rudder(**settings: float) -> PrimitiveSpec:
    return spec("rudder_steps", **{"speed_mps": 5.0, "steps": 2.0, "helm_rad": 0.4, **settings})


def levels(run: Primitive, name: str) -> list[float]:
    """Commands that are held for more than a few seconds, in order."""
    values = run.commands.column(name)
    ends = np.append(np.flatnonzero(np.diff(values)), len(values) - 1)
    return [float(values[end]) for end, samples in zip(ends, np.diff(ends, prepend=-1), strict=True) if samples > 20]


def test_a_straight_level_of_a_known_vessel_lasts_four_of_its_slowest_time_constant_and_the_time_to_look() -> None:
    ship = certain()
    approach = steady_ahead(ship, 5.0)
    slowest_s = 1.0 / (0.06 + 2 * 0.008 * 5.0)  # of surge: X_u + 2 X_abs_u_u u
    found = hold_times(ship, approach.velocity[None], approach.inputs[None], SETTINGS)
    assert found[0] == pytest.approx(SETTLED * slowest_s + 10.0, rel=1e-3)


def test_a_run_has_a_circle_for_each_turning_level() -> None:
    run, short, none = (build_primitive(certain(), rudder(circle_s=most)) for most in (1e4, 30.0, 0.0))
    assert len(levels(run, "rudder1")) == 5
    turned = abs(run.trajectory.pose[-1, 2])
    assert turned > 3 * 2 * np.pi  # four turning levels, one straight at each end
    assert none.duration_s < short.duration_s < run.duration_s


def test_a_level_ends_with_a_circle_where_there_is_time_else_with_half_of_one() -> None:
    ship = certain()
    approach = steady_ahead(ship, 5.0)
    turn = steady_turn(approach, 0.2)
    circle_s, given = 2 * np.pi / abs(turn[2]), np.array([approach.helm.inputs(approach.drive, 0.2)])
    looks = [
        float(hold_times(ship, turn[None], given, SETTINGS | {"circle_s": share * circle_s, "steady_s": 1.0})[0])
        for share in (1.01, 0.99, 0.51, 0.49)
    ]
    assert looks[0] - looks[1] == pytest.approx(circle_s / 2)
    assert looks[1] == looks[2]
    assert looks[2] - looks[3] == pytest.approx(circle_s / 2 - 1.0)


@pytest.mark.parametrize("sure", [0.6, 0.8, 0.9])
def test_straight_levels_are_long_enough_for_the_stated_share_of_vessels(sure: float) -> None:
    ship, rng, draws = load_vessel(GUESS), np.random.default_rng(7), 300
    run = build_primitive(ship, spec("throttle_steps", speed_mps=3.0, rise=2.0, steps=1.0, sure=sure))
    held_s = ship.sample_time_s * (1 + np.flatnonzero(np.diff(run.commands.column("n1")))[0])
    slowest = []
    for theta in ship.model.drawn_parameters(draws, rng):
        one = ship.model.with_parameters(theta)
        nudges, inputs = 1e-4 * np.eye(3), tuple(run.entry_inputs)
        slopes = np.array(
            [
                np.subtract(
                    one.accelerations(tuple(run.entry_velocity + nudge), (0.0, 0.0), inputs),
                    one.accelerations(tuple(run.entry_velocity - nudge), (0.0, 0.0), inputs),
                )
                / 2e-4
                for nudge in nudges
            ]
        ).T
        slowest.append(-np.linalg.eigvals(slopes).real.max())
    long_enough = np.mean(np.array(slowest) * (held_s - 10.0) >= SETTLED)
    assert long_enough == pytest.approx(sure, abs=4 * np.sqrt(sure * (1 - sure) * (1 / draws + 1 / 400)))


def test_the_helm_is_less_at_fast_engine_orders() -> None:
    ship = certain()
    limit = {"fast_order": 0.7, "fast_helm_rad": 0.15}
    run = build_primitive(ship, spec("throttle_steps", speed_mps=2.0, rise=4.0, steps=3.0, helm_rad=0.3, **limit))
    n1, helm = run.commands.column("n1"), np.abs(run.commands.column("rudder1"))
    settled = np.flatnonzero(np.diff(n1, prepend=n1[0] - 1) == 0)[20:]
    assert helm[settled][n1[settled] > 0.72 * 20.0].max() == pytest.approx(0.15)
    assert helm.max() == pytest.approx(0.3)
    fast = build_primitive(ship, rudder(fast_order=0.1, fast_helm_rad=0.15))
    assert np.abs(fast.commands.column("rudder1")).max() == pytest.approx(0.15)


def test_a_shifted_second_run_has_its_levels_half_way_between_those_of_the_first() -> None:
    settings = {"speed_mps": 2.0, "rise": 4.0, "steps": 3.0, "duration_s": 600.0}
    ends = []
    for shift in (0.0, 0.5):
        run = build_primitive(certain(), spec("throttle_steps", shift=shift, **settings))
        held = np.unique(levels(run, "n1"))
        ends.append(held)
    assert len(ends[0]) == 4
    assert len(ends[1]) == 3
    assert ((ends[0][:-1] < ends[1]) & (ends[1] < ends[0][1:])).all()


def test_rudder_steps_may_turn_all_the_time() -> None:
    run = build_primitive(certain(), rudder(least_helm_rad=0.1))
    assert min(map(abs, levels(run, "rudder1"))) == pytest.approx(0.1, abs=0.02)
    with pytest.raises(InputError, match=r"least_helm_rad is 0\.5, expected less"):
        build_primitive(certain(), rudder(least_helm_rad=0.5))


def test_a_prior_of_which_too_few_become_steady_is_refused() -> None:
    ship = load_vessel(GUESS)
    wild = replace(ship, model=replace(ship.model, parameter_range={}, parameter_std=3 * ship.model.parameter_std))
    with pytest.raises(InputError, match="become steady at 3 m/s"):
        build_primitive(wild, spec("throttle_steps", speed_mps=3.0, rise=2.0, steps=1.0))


def test_waves_swing_about_the_approach() -> None:
    ship = certain()
    waves = {"helm_rad": 0.2, "helm_period_s": 20.0, "engine_swing": 0.1, "engine_period_s": 50.0}
    run = build_primitive(ship, spec("helm_and_engine_waves", duration_s=100.0, speed_mps=5.0, **waves))
    helm, n1 = run.commands.column("rudder1"), run.commands.column("n1")
    assert np.abs(helm).max() == pytest.approx(0.2, rel=0.01)
    assert np.ptp(n1) == pytest.approx(2 * 0.1 * 20.0, rel=0.01)
    assert abs(helm.mean()) < 0.01
    with pytest.raises(InputError, match=r"engine_swing is 0\.5, expected at most"):
        build_primitive(
            ship, spec("helm_and_engine_waves", duration_s=100.0, speed_mps=5.0, **{**waves, "engine_swing": 0.5})
        )


def test_the_circle_that_a_level_ends_with_averages_a_current_out_and_a_part_of_one_does_not() -> None:
    ship, current_mps = certain(), 0.4
    run = build_primitive(ship, rudder(least_helm_rad=0.2, speed_mps=3.0))
    sea = Environment(current_to=np.array([current_mps, 0.0]))
    over_ground = np.hypot(
        *simulate(ship, run.commands, velocity=run.entry_velocity, environment=sea).velocity[:, :2].T
    )
    through_water = np.hypot(*run.trajectory.velocity[:, :2].T)
    helm = run.commands.column("rudder1")
    end = int(np.flatnonzero(helm == helm.max())[-1])
    speed, rate = through_water[end], abs(run.trajectory.velocity[end, 2])
    circle, part = (round(share * 2 * np.pi / rate / ship.sample_time_s) for share in (1.0, 0.25))
    left_mps = over_ground[end - circle : end].mean() - speed
    assert abs(left_mps) < 1.5 * current_mps**2 / (4 * speed) + current_mps / circle
    assert max(abs(over_ground[end - part - lag : end - lag].mean() - speed) for lag in range(0, circle, 5)) > 0.8 * (
        current_mps * np.sin(np.pi / 4) / (np.pi / 4)
    )
