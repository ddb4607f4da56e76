"""What a ship with propeller and rudder does on legs is what its model does: turns, speeds, way to gather and lose."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from expdesign.errors import NoPlan
from expdesign.plan import PlanSettings
from expdesign.plan.control import AgileShip, HelmShip
from expdesign.plan.control.helm_capability import LATERAL_MPS2, steady_turns
from expdesign.plan.control.ships import capability, needs_helm
from expdesign.scenario import load_vessel
from expdesign.signals import Commands
from expdesign.simulation import Conduct, simulate, steady_ahead, stopping, turning_circle
from helm_case import catamaran, coaster
from plan_case import VESSELS
from plan_case import ship as tug

# block coefficient, propeller diameter, thrust deduction, wake, interaction: as the vessel file says
WATER, BLOCK, DIAMETER, DEDUCTION, WAKE = 1025.0, 0.70, 3.0, 0.20, 0.30
THRUST = (0.35, -0.40)
STRAIGHTENED, EXTRA, EXTRA_PLACE, RUDDER_DEDUCTION = 0.6, 0.2, -0.45, 0.3


TEMPLATES = Path(__file__).parents[1] / "expdesign" / "templates"


@cache
def able(ship):
    """Its capability, with no wishes."""
    return capability(ship, PlanSettings())


def hull(length: float, beam: float, draught: float) -> dict[str, float]:
    """Masses and linear forces by Clarke, Gedling and Hine (1983), Soeding (1982); drag and wetted surface."""
    volume, slender = length * beam * draught * BLOCK, np.pi * (draught / length) ** 2
    bt, bl, tl = beam / draught, beam / length, draught / length
    mass = 0.5 * WATER * length**3 * slender
    push = 0.5 * WATER * length**2 * slender
    added_y = mass * (1 + 0.16 * BLOCK * bt - 5.1 * bl**2)
    return {
        "m": WATER * volume,
        "m_u": WATER * volume + 2.7 * WATER * volume ** (5 / 3) / length**2,
        "added_v": added_y,
        "m_v": WATER * volume + added_y,
        "I": WATER * volume * (0.25 * length) ** 2 + mass * length**2 * (1 / 12 + 0.017 * BLOCK * bt - 0.33 * bl),
        "Y_v": -push * (1 + 0.4 * BLOCK * bt),
        "Y_r": -push * length * (-0.5 + 2.2 * bl - 0.08 * bt),
        "N_v": -push * length * (0.5 + 2.4 * tl),
        "N_r": -push * length**2 * (0.25 + 0.039 * bt - 0.56 * bl),
        "R": 0.5 * WATER * (1.7 * length * draught + volume / draught) * 3.5e-3,
    }


def cross_flow() -> tuple[np.ndarray, np.ndarray]:
    """Factors of |v|v, |r|v and of |r|r, |v|r (unit length) fitted to a drag coefficient of 1 on strips."""
    x = np.linspace(-0.5, 0.5, 2001)
    v, r = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-2, 2, 41)))
    flow = v[:, None] + x * r[:, None]
    side, turn = (np.trapezoid(arm * np.abs(flow) * flow, x, axis=1) for arm in (1.0, x))
    first = np.linalg.lstsq(np.stack([abs(v) * v, abs(r) * v], axis=1), side, rcond=None)[0]
    second = np.linalg.lstsq(np.stack([abs(r) * r, abs(v) * r], axis=1), turn, rcond=None)[0]
    return first, second


def by_formulas(length: float, beam: float, draught: float) -> dict[str, float]:
    h, (side, turn) = hull(length, beam, draught), cross_flow()
    area, aspect = length * draught / 50, 1.6
    lift = 0.5 * WATER * area * 6.13 * aspect / (2.25 + aspect)
    bollard = (1 - DEDUCTION) * WATER * DIAMETER**4 * THRUST[0]
    advance = (1 - DEDUCTION) * WATER * DIAMETER**3 * THRUST[1] * (1 - WAKE)
    revolutions = (-advance + np.sqrt(advance**2 + 4 * bollard * h["R"])) / (2 * bollard)  # per m/s, self-propelled
    gain = 0.8 * 0.6 * 8 / np.pi
    race = THRUST[0] * (revolutions * DIAMETER) ** 2 + THRUST[1] * (1 - WAKE) * revolutions * DIAMETER
    past = (1 - WAKE) ** 2 + gain * race
    lever = -0.5 * length + EXTRA * EXTRA_PLACE * length
    damping, arm = STRAIGHTENED * lift * past, -0.9 * length
    strip = 0.5 * WATER * draught * length
    return {
        "X_abs_u_u": -h["R"] / h["m_u"],
        "X_vr": (h["m"] + 0.5 * h["added_v"]) / h["m_u"],
        "X_nn": bollard / h["m_u"],
        "X_un": advance / h["m_u"],
        "X_dd": -(1 - RUDDER_DEDUCTION) * lift * past / h["m_u"],
        "Y_uv": (h["Y_v"] - (1 + EXTRA) * damping) / h["m_v"],
        "Y_ur": (h["Y_r"] - (1 + EXTRA) * damping * arm - h["m"]) / h["m_v"],
        "Y_abs_v_v": -strip * side[0] / h["m_v"],
        "Y_abs_r_v": -strip * length * side[1] / h["m_v"],
        "Y_ud": -(1 + EXTRA) * lift * (1 - WAKE) ** 2 / h["m_v"],
        "Y_nd": -(1 + EXTRA) * lift * gain / 2 / h["m_v"],
        "N_uv": (h["N_v"] - lever * damping) / h["I"],
        "N_ur": (h["N_r"] - lever * damping * arm) / h["I"],
        "N_abs_v_r": -strip * length**2 * turn[1] / h["I"],
        "N_abs_r_r": -strip * length**3 * turn[0] / h["I"],
        "N_ud": -lever * lift * (1 - WAKE) ** 2 / h["I"],
        "N_nd": -lever * lift * gain / 2 / h["I"],
    }


def test_the_coaster_is_what_the_published_formulas_make_of_her_particulars():
    ship = coaster()
    made = by_formulas(ship.length_m, ship.beam_m, ship.draught_m)
    assert set(made) == set(ship.model.names)
    for name, value in zip(ship.model.names, ship.model.parameters, strict=True):
        assert value == pytest.approx(made[name], rel=1e-3), name


@pytest.mark.parametrize("speed", [3.0, 6.0])
def test_the_turning_circle_is_the_steady_turn_of_the_model_solved_for(speed):
    ship, approach = coaster(), steady_ahead(coaster(), speed)
    turns = steady_turns(approach)
    hardest = turns[-1]
    commands = approach.helm.inputs(approach.drive, approach.angle_rad + approach.starboard * hardest.helm_rad)

    def left(motion):
        u, v, r = motion
        return ship.model.accelerations((u, v, r / ship.length_m), (u, v), commands)

    u, v, r = fsolve(left, [0.4 * speed, -0.1 * speed, 0.4 * speed], xtol=1e-12)
    assert hardest.radius_m == pytest.approx(np.hypot(u, v) / (r / ship.length_m), rel=1e-6)
    assert hardest.drift_rad == pytest.approx(np.arctan2(v, u), rel=1e-6)
    _, track = turning_circle(ship, turn_rad=12 * np.pi, conduct=Conduct(speed_mps=speed))
    points = track.pose[track.pose[:, 2] > 10 * np.pi, :2]  # the last turn: a circle through its points
    fit = np.linalg.lstsq(np.column_stack([2 * points, np.ones(len(points))]), (points**2).sum(axis=1), rcond=None)[0]
    assert np.sqrt(fit[2] + fit[:2] @ fit[:2]) == pytest.approx(hardest.radius_m, rel=0.01)


def test_port_and_starboard_are_alike_for_a_symmetric_ship():
    for ship in (coaster(), catamaran()):
        turns = steady_turns(steady_ahead(ship, 0.8 * able(ship).transit_speed_mps))
        for port, starboard in zip(turns, turns[::-1], strict=True):
            assert port.radius_m == pytest.approx(starboard.radius_m, rel=1e-6)
            assert port.drift_rad == pytest.approx(-starboard.drift_rad, rel=1e-6)


def test_legs_turn_no_tighter_than_the_helm_can_hold_and_never_on_the_spot():
    for ship in (coaster(), catamaran()):
        found = able(ship)
        assert needs_helm(ship)
        assert isinstance(found, HelmShip)
        assert found.spot_rate_radps == 0
        assert found.turning_radius_m >= max(found.turns[0].radius_m, found.turns[-1].radius_m, 1.5 * ship.length_m)
        gentle = [turn for turn in found.turns if turn.radius_m >= found.turning_radius_m]
        assert all(abs(turn.surge_mps * turn.yaw_rate_radps) <= LATERAL_MPS2 for turn in gentle)


def test_a_radius_that_hard_over_does_not_give_is_refused_with_both_numbers():
    ship = coaster()
    tightest = able(ship).turns[-1].radius_m
    with pytest.raises(NoPlan, match=rf"turning_radius_m is 60, at .* needs {tightest:.3g} m or more"):
        capability(ship, PlanSettings(turning_radius_m=60.0))
    assert capability(ship, PlanSettings(turning_radius_m=300.0)).turning_radius_m == 300.0


def test_top_speed_is_where_thrust_at_full_ahead_is_resistance():
    ship = coaster()
    theta = dict(zip(ship.model.names, ship.model.parameters, strict=True))
    roots = np.roots([theta["X_abs_u_u"], theta["X_un"] * 3.4, theta["X_nn"] * 3.4**2])
    assert able(ship).top_speed_mps == pytest.approx(roots.max(), rel=1e-6)


def test_the_stated_acceleration_loses_the_time_that_full_ahead_from_rest_loses():
    ship, found = coaster(), able(coaster())
    speed = found.transit_speed_mps
    values = np.column_stack([np.minimum(3.4, 0.1 * np.arange(1, 601)), np.zeros(600)])
    track = simulate(ship, Commands(sample_time_s=1.0, names=ship.model.inputs, values=values))
    there = int(np.argmax(track.velocity[:, 0] > 0.98 * speed))
    lost_s = there - track.pose[there, 0] / speed
    assert speed / (2 * found.acceleration_mps2) == pytest.approx(lost_s, rel=0.02)
    _, stop = stopping(ship, conduct=Conduct(speed_mps=speed))
    assert found.stopping_m == pytest.approx(stop.pose[-1, 0], rel=1e-3)


def growth(ship) -> float:
    """The rate at which the fastest of small sways and turns at 5 m/s grows, helm amidships [1/s]."""
    inputs, tilt = steady_ahead(ship, 5.0).inputs, 1e-6
    columns = [ship.model.accelerations((5.0, *(tilt * unit)), (5.0, tilt * unit[0]), inputs)[1:] for unit in np.eye(2)]
    return float(np.linalg.eigvals(np.array(columns).T / tilt).real.max())


def test_a_ship_that_is_unstable_on_course_still_has_turns():
    ship = coaster()
    names = list(ship.model.names)
    values = ship.model.parameters.copy()
    values[names.index("N_uv")] *= 1.8
    lively = replace(ship, model=ship.model.with_parameters(values))
    assert growth(ship) < 0 < growth(lively)
    found = capability(lively, PlanSettings())
    assert found.turns[-1].radius_m < able(ship).turns[-1].radius_m


def test_a_vessel_with_forces_in_every_direction_needs_no_helm():
    assert not needs_helm(tug())
    assert not needs_helm(load_vessel(VESSELS / "model-ship.toml"))


@pytest.mark.thorough
def test_thrusters_steer_a_ship_on_legs_only_where_they_hold_a_turn_against_her_hull():
    """A hull that turning pushes outwards goes round by drifting: held without drift, she would go straight on."""
    ship = load_vessel(TEMPLATES / "azimuth" / "vessel.toml")
    values = dict(zip(ship.model.names, ship.model.parameters.tolist(), strict=True))
    tunnel = {name: 3 * values[name] for name in ("Y_T3", "N_T3", "Y_uT3", "N_uT3")}
    slender = {name: 0.02 * values[name] for name in ("Y_ur", "N_ur")}
    for hull, kind in (({}, HelmShip), (slender, AgileShip)):
        made = replace(ship, model=ship.model.with_parameters(values | tunnel | hull))
        assert not needs_helm(made)  # at rest she turns on the spot and goes sideways
        assert isinstance(capability(made, PlanSettings()), kind)
