"""Indices of a ship that obeys Nomoto's first-order equation are those of its closed forms.

Helm K d from t = 0: r = K d (1 - exp(-t/T)), heading K d (t - T (1 - exp(-t/T))); after a reversal at yaw rate r1 the
heading goes on by T r1 - K d T ln(1 + r1 / (K d)).
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from expdesign.errors import InputError
from expdesign.indices import OUTCOMES, Circle, Stop, ZigZag, criteria, judge, outcomes, standard_results, steered_run
from expdesign.indices.read import read_circle
from expdesign.simulation import Conduct, turning_circle
from nomoto_ship import GAIN, LAG, nomoto_ship

SPEED, TEN, TWENTY, FULL = 7.0, math.radians(10), math.radians(20), math.radians(35)
SHIP = nomoto_ship(helm_rate=math.inf)


def heading(helm_rad: float, time_s: float) -> float:
    return GAIN * helm_rad * (time_s - LAG * (1 - math.exp(-time_s / LAG)))


def turned(helm_rad: float, angle_rad: float) -> float:
    return float(brentq(lambda t: heading(helm_rad, t) - angle_rad, 0.0, 1e4))


def way(helm_rad: float, until_s: float, direction: object) -> float:
    return SPEED * quad(lambda t: direction(heading(helm_rad, t)), 0.0, until_s)[0]


@pytest.mark.parametrize("side", ["starboard", "port"])
def test_the_turning_circle_is_the_integral_of_its_heading(side: str) -> None:
    circle = next(c for c in standard_results(SHIP, speed_mps=SPEED).circles if c.side == side)
    quarter, half = turned(FULL, math.pi / 2), turned(FULL, math.pi)
    assert circle.helm_rad == pytest.approx(FULL)
    assert circle.advance_m == pytest.approx(way(FULL, quarter, math.cos), rel=1e-4)
    assert circle.transfer_m == pytest.approx(way(FULL, quarter, math.sin), rel=1e-4)
    assert circle.tactical_diameter_m == pytest.approx(way(FULL, half, math.sin), rel=1e-4)
    assert circle.initial_turning_m == pytest.approx(SPEED * turned(FULL, TEN), rel=1e-4)
    assert circle.steady_diameter_m == pytest.approx(2 * SPEED / (GAIN * FULL), rel=1e-3)


@pytest.mark.parametrize("angle", [TEN, TWENTY])
def test_the_first_overshoot_is_the_closed_form(angle: float) -> None:
    found = next(z for z in standard_results(SHIP, speed_mps=SPEED).zigzags if abs(z.helm_rad - angle) < 1e-9)
    time = turned(angle, angle)
    rate = GAIN * angle * (1 - math.exp(-time / LAG))
    rest = LAG * rate - GAIN * angle * LAG * math.log(1 + rate / (GAIN * angle))
    assert found.overshoots_rad[0] == pytest.approx(rest, rel=2e-3)
    assert found.executes[1].time_s == pytest.approx(time, rel=1e-4)
    assert found.initial_turning_m == pytest.approx(SPEED * turned(angle, TEN), rel=1e-4)


def test_the_stop_is_that_of_quadratic_resistance_and_constant_thrust() -> None:
    """u' = -a u^2 - b: the distance until u = 0 is ln(1 + a u0^2 / b) / (2 a)."""
    ship = replace(
        SHIP,
        model=replace(SHIP.model, actuators=(replace_rate(SHIP.actuators[0], math.inf), SHIP.actuators[1])),
    )
    a, b = 1e-3, 1e-3 * 6.0**2
    found = standard_results(ship, speed_mps=SPEED).stops[0]
    assert found.track_reach_m == pytest.approx(math.log(1 + a * SPEED**2 / b) / (2 * a), rel=1e-4)
    assert found.head_reach_m == pytest.approx(found.track_reach_m)
    assert found.time_s == pytest.approx(math.atan(SPEED * math.sqrt(a / b)) / math.sqrt(a * b), rel=1e-4)


def replace_rate(actuator: object, rate: float) -> object:
    return replace(actuator, responses=tuple(replace(response, rate=rate) for response in actuator.responses))


def test_a_uniform_current_is_found_and_taken_out() -> None:
    flow = np.array([0.4, -0.25])
    commands, still = turning_circle(SHIP, turn_rad=4 * math.pi, conduct=Conduct(speed_mps=SPEED))
    time, course = still.time_s[:, None], still.pose[:, 2]
    c, s = np.cos(course), np.sin(course)
    pose, velocity = np.array(still.pose), np.array(still.velocity)
    pose[:, :2] += flow * time
    velocity[:, 0] += flow[0] * c + flow[1] * s
    velocity[:, 1] += flow[1] * c - flow[0] * s
    drifted = replace(still, pose=pose, velocity=velocity)
    how = {"order_s": 0.0, "course_rad": 0.0, "side": 1, "helm_rad": FULL, "speed_mps": SPEED}
    calm = read_circle(steered_run(SHIP, commands, still, name="calm"), current=False, **how)
    found = read_circle(steered_run(SHIP, commands, drifted, name="in current"), current=True, **how)
    assert (found.current_north_mps, found.current_east_mps) == pytest.approx(tuple(flow), abs=1e-4)
    for key in ("advance_m", "transfer_m", "tactical_diameter_m", "steady_diameter_m"):
        assert getattr(found, key) == pytest.approx(getattr(calm, key), rel=1e-3)


def test_outcomes_are_the_requested_results_by_name() -> None:
    results = standard_results(SHIP, speed_mps=SPEED)
    ten, twenty = results.zigzags[:2]
    found = outcomes(SHIP, speed_mps=SPEED)
    assert tuple(found) == tuple(OUTCOMES)
    assert found["tactical_diameter_m"] == pytest.approx(results.circles[0].tactical_diameter_m)
    assert found["overshoot_10_10_rad"] == pytest.approx(ten.overshoots_rad[0])
    assert found["overshoot_20_20_rad"] == pytest.approx(twenty.overshoots_rad[0])
    assert found["stopping_distance_m"] == pytest.approx(results.stops[0].track_reach_m)
    assert outcomes(SHIP, speed_mps=SPEED, names=("advance_m",)) == {"advance_m": found["advance_m"]}
    with pytest.raises(InputError, match="'advance' is not known, expected some of advance_m"):
        outcomes(SHIP, names=("advance",))


@pytest.mark.thorough
def test_outcomes_change_evenly_with_parameters() -> None:
    """Central differences of two sizes agree, so derivatives mean something."""
    ship = nomoto_ship(sample_time_s=1.0)

    def slope(name: str, parameter: int, step: float) -> float:
        ends = []
        for way in (1, -1):
            values = ship.model.parameters.copy()
            values[parameter] *= 1 + way * step
            ends.append(outcomes(ship, speed_mps=SPEED, parameters=values, names=(name,))[name])
        return (ends[0] - ends[1]) / (2 * step)

    for name in ("overshoot_10_10_rad", "tactical_diameter_m", "advance_m", "initial_turning_m"):
        for parameter in (2, 3):
            fine, coarse = slope(name, parameter, 0.01), slope(name, parameter, 0.03)
            assert fine == pytest.approx(coarse, rel=0.05, abs=1e-3 * abs(coarse) + 1e-6)


@pytest.mark.parametrize(
    ("ratio_s", "first", "second"),
    [(5, 10, 25), (10, 10, 25), (20, 15, 32.5), (30, 20, 40), (45, 20, 40)],
)
def test_limits_on_overshoots_are_those_of_the_resolution(ratio_s: float, first: float, second: float) -> None:
    """Source: IMO MSC.137(76), 5.3.3: the branches meet at 10 s and 30 s."""
    limits = {row.key: row.limit for row in criteria(200.0, 200.0 / ratio_s)}
    assert math.degrees(limits["overshoot_10_10_rad"]) == pytest.approx(first)
    assert math.degrees(limits["second_overshoot_10_10_rad"]) == pytest.approx(second)
    assert math.degrees(limits["overshoot_20_20_rad"]) == pytest.approx(25.0)
    assert [limits[f"{key}_m"] for key in ("advance", "tactical_diameter", "initial_turning", "track_reach")] == [
        900, 1000, 500, 3000
    ]  # fmt: skip


def test_a_model_is_judged_by_the_ship_it_stands_for() -> None:
    model, ship = criteria(4.0, 0.8, scale=25.0), criteria(100.0, 4.0)
    for one, other in zip(model, ship, strict=True):
        scale = 25.0 if one.key.endswith("_m") else 1.0
        assert one.limit * scale == pytest.approx(other.limit)


def test_verdicts_compare_each_index_with_its_limit() -> None:
    wide = Circle(
        name="wide", side="port", helm_rad=FULL, speed_mps=5.0, advance_m=451.0, transfer_m=1.0,
        tactical_diameter_m=499.0, initial_turning_m=1.0, steady_diameter_m=None,
    )  # fmt: skip
    odd = ZigZag(
        name="15/15", side="port", heading_rad=math.radians(15), helm_rad=math.radians(15), speed_mps=5.0,
        executes=(), overshoots_rad=(1.0,), initial_turning_m=None,
    )  # fmt: skip
    late = Stop(
        name="late", speed_mps=5.0, track_reach_m=1501.0, head_reach_m=1.0, lateral_m=0.0, heading_change_rad=0.0,
        time_s=1.0,
    )  # fmt: skip
    found = [(v.run, v.criterion.key, v.met) for v in judge((wide, odd, late), length_m=100.0)]
    assert found == [
        ("wide", "advance_m", False),
        ("wide", "tactical_diameter_m", True),
        ("late", "track_reach_m", False),
    ]
