"""Forces from particulars are the published formulas', obey mechanics, and hold from rest to full speed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import published_models as published
import published_trials as trials
from expdesign.particulars import FACTORS, Card, Hull, Rudder, Thruster, Trial, Windage
from expdesign.particulars.forces import bollard_n, forces, open_water, propellers, tunnel
from expdesign.particulars.hull import derivatives, factors, ittc_57, masses, modulus, resistance
from expdesign.particulars.model import parameters, vessel_of
from expdesign.particulars.trials import Fleet
from expdesign.vessel import SCALAR
from expdesign.vessel.structures import parse_expression

NONE = np.zeros(len(FACTORS))
KVLCC2 = Hull(length_m=320.0, beam_m=58.0, draught_m=20.8, mass_kg=312600e3 * 1.025, gravity_forward_m=11.2)
SEIUN = Hull(length_m=105.0, beam_m=17.91, draught_m=5.966, mass_kg=5701.6e3 * 1.025)
SCREW = Thruster(kind="propeller", forward_m=-150.0, diameter_m=9.86)
TANKER = Card(
    name="tanker", hull=KVLCC2, thrusters=(SCREW,), rudders=(Rudder(area_m2=112.5, forward_m=-160.0),),
    top_speed_mps=7.97,
)  # fmt: skip
HARBOUR = Card(
    name="harbour",
    hull=Hull(length_m=45.0, beam_m=11.0, draught_m=3.6, mass_kg=1.05e6, gravity_forward_m=-1.0),
    thrusters=(
        Thruster(kind="azimuth", forward_m=-20.0, starboard_m=-3.0, diameter_m=1.9, power_w=9e5),
        Thruster(kind="azimuth", forward_m=-20.0, starboard_m=3.0, diameter_m=1.9, power_w=9e5),
        Thruster(kind="tunnel", forward_m=18.0, power_w=2.5e5),
    ),
    windage=Windage(frontal_m2=95.0, lateral_m2=260.0, centre_forward_m=3.0),
    top_speed_mps=6.7,
)


def test_friction_is_the_line_of_1957() -> None:
    assert ittc_57(1e7) == pytest.approx(0.0030, abs=1e-5)  # 0.075 / 5^2
    assert ittc_57(1e9) == pytest.approx(0.001531, abs=1e-6)  # 0.075 / 7^2


def test_added_masses_of_kvlcc2_are_within_their_scatter() -> None:
    """Measured, Yasukawa and Yoshimura 2015: m_x' 0.022, m_y' 0.223, J_z' 0.011, by rho/2 L^2 T and rho/2 L^4 T."""
    found, unit = masses(KVLCC2, factors(KVLCC2, NONE)), 0.5 * 1025 * 320**2 * 20.8
    own = KVLCC2.mass_kg * ((320 / 4) ** 2 + 11.2**2)
    assert (found.sway_kg - KVLCC2.mass_kg) / unit == pytest.approx(0.223, rel=0.15)
    assert (found.yaw_kgm2 - own) / (unit * 320**2) == pytest.approx(0.011, rel=0.2)
    ahead = next(factor for factor in FACTORS if factor.name == "added mass ahead")
    assert abs(math.log((found.surge_kg - KVLCC2.mass_kg) / unit / 0.022)) < 2 * ahead.std_log


def test_derivatives_are_the_published_worked_numbers_of_seiun_maru() -> None:
    """Yoshimura and Masumoto 2012: those of Seiun Maru that are the regressions' own."""
    sway, yaw = derivatives(SEIUN)
    assert sway[3:] == pytest.approx((-0.75, -0.8599, -0.051), abs=1e-3)
    assert (yaw[0], yaw[2], yaw[3]) == pytest.approx((-0.1136, -0.3095, -0.6257), abs=1e-3)


@pytest.mark.parametrize("hull", [KVLCC2, SEIUN])
def test_modulus_terms_give_the_cubics_in_turns_and_cross_flow_at_rest(hull: Hull) -> None:
    terms = np.array(modulus(hull, factors(hull, NONE)))
    for drift, rate in ((0.2, 0.5), (0.3, 0.7), (0.35, 0.8)):
        u, v, r = math.cos(drift), -math.sin(drift), rate
        cubic = np.array(derivatives(hull)) @ [v, r, v**3, v * v * r, v * r * r, r**3]
        both = terms @ [u * v, u * r, abs(v) * v, abs(r) * v, abs(v) * r, abs(r) * r]
        assert both[0] == pytest.approx(cubic[0], rel=0.08)
        assert both[1] == pytest.approx(cubic[1], abs=0.25 * abs(terms[1, 1]) * rate)  # a difference of large terms
    drag = next(factor for factor in FACTORS if factor.name == "cross-flow drag")
    assert abs(math.log(-terms[0, 2] / 0.8)) < drag.std_log


def test_a_tug_has_the_bollard_pull_that_its_builder_states() -> None:
    """53 t of two thrusters in nozzles, 1566 kW and 2.16 m, pitch ratio 0.96: booklet of a tug, Transas Marine 2006."""
    screw = Thruster(kind="azimuth", forward_m=-9.0, diameter_m=2.16, power_w=1566e3, pitch_ratio=0.96)
    hull = Hull(length_m=23.2, beam_m=10.4, draught_m=3.3, mass_kg=366e3)
    card = Card(name="tug", hull=hull, thrusters=(screw, replace(screw, starboard_m=3.0)))
    pull = sum(one.at_rest / (1 - one.deduction) * one.max_rps**2 for one in propellers(card))
    assert pull == pytest.approx(53e3 * 9.81, rel=0.2)
    assert 2 * bollard_n(1566e3, 2.16) == pytest.approx(53e3 * 9.81, rel=0.25)


@pytest.mark.parametrize(
    ("pitch_ratio", "k_t"),
    [(0.721, (0.2931, -0.2753, -0.1385)), (0.7151, (0.3278, -0.3323, -0.156))],
    ids=["KVLCC2, Yasukawa and Yoshimura 2015", "Esso Osaka, Miyauchi et al. 2022"],
)
def test_propellers_are_near_published_open_water_curves(pitch_ratio: float, k_t: tuple[float, float, float]) -> None:
    at_rest, loss = open_water(pitch_ratio)
    assert at_rest == pytest.approx(k_t[0], rel=0.10)
    assert at_rest / loss == pytest.approx(max(np.roots(k_t[::-1])), rel=0.06)  # advance coefficient without thrust


def test_thrust_at_full_order_is_the_resistance_at_the_top_speed() -> None:
    vessel = vessel_of(TANKER, propellers(TANKER), NONE)
    screw = propellers(TANKER)[0]
    gained = vessel.model.accelerations((7.97, 0.0, 0.0), (7.97, 0.0), [screw.max_rps, 0.0], SCALAR)[0]
    drag = resistance(KVLCC2, 7.97) * 7.97**2 / masses(KVLCC2, factors(KVLCC2, NONE)).surge_kg
    assert abs(gained) < 1e-3 * drag


@pytest.mark.parametrize("card", [TANKER, HARBOUR])
def test_accelerations_are_forces_by_the_mass_matrix(card: Card) -> None:
    driving, given = propellers(card), factors(card.hull, NONE)
    vessel = vessel_of(card, driving, NONE)
    mass = masses(card.hull, given)
    velocity, inputs = (2.0, -0.4, 0.01), [0.7] * len(vessel.model.inputs)
    table = vessel.model.signals(velocity, (3.0, 1.0), inputs, SCALAR)
    total = np.zeros(3)
    for force in forces(card, driving, given):
        sway = parse_expression(force.expression, signals=tuple(table)).evaluate(table, SCALAR)
        yaw = parse_expression(force.yaw_expression or force.expression, signals=tuple(table)).evaluate(table, SCALAR)
        total += np.array([force.x_n * sway, force.y_n * sway, force.n_nm * yaw])
    matrix = np.array([[mass.sway_kg, mass.coupling_kgm], [mass.coupling_kgm, mass.yaw_kgm2]])
    sway_yaw = np.linalg.solve(matrix, total[1:])
    found = vessel.model.accelerations(velocity, (3.0, 1.0), inputs, SCALAR)
    assert np.array(found) == pytest.approx([total[0] / mass.surge_kg, *sway_yaw], rel=1e-9)


def test_a_mirrored_motion_has_mirrored_accelerations() -> None:
    model = vessel_of(TANKER, propellers(TANKER), NONE).model
    one = model.accelerations((5.0, 0.7, -0.01), (6.0, 2.0), [1.0, 0.3], SCALAR)
    other = model.accelerations((5.0, -0.7, 0.01), (6.0, -2.0), [1.0, -0.3], SCALAR)
    assert np.array(one) == pytest.approx([other[0], -other[1], -other[2]], rel=1e-12)


def test_tunnel_thrust_is_the_bollard_pull_at_rest_and_fades_to_nothing() -> None:
    model = vessel_of(HARBOUR, propellers(HARBOUR), NONE).model
    diameter, power, rps = tunnel(HARBOUR.thrusters[2], HARBOUR)

    def sway(speed: float) -> float:
        inputs = [0.0, 0.0, 0.0, 0.0, rps]
        still = model.accelerations((speed, 0.0, 0.0), (speed, 0.0), [0.0] * 5, SCALAR)[1]
        return float(model.accelerations((speed, 0.0, 0.0), (speed, 0.0), inputs, SCALAR)[1] - still)

    mass = masses(HARBOUR.hull, factors(HARBOUR.hull, NONE))
    matrix = np.linalg.inv([[mass.sway_kg, mass.coupling_kgm], [mass.coupling_kgm, mass.yaw_kgm2]])
    assert sway(0.0) == pytest.approx(matrix[0] @ [1.0, 18.0] * bollard_n(power, diameter), rel=1e-6)
    assert sway(2.0) < 0.6 * sway(0.0)
    assert sway(8.0) == 0.0


def test_wind_pushes_where_it_goes_and_a_ship_at_rest_without_orders_stays() -> None:
    model = vessel_of(HARBOUR, propellers(HARBOUR), NONE).model
    assert model.accelerations((0.0, 0.0, 0.0), (0.0, 0.0), [0.0] * 5, SCALAR) == pytest.approx((0, 0, 0), abs=1e-12)
    ahead = model.accelerations((0.0, 0.0, 0.0), (-10.0, 0.0), [0.0] * 5, SCALAR)[0]
    starboard = model.accelerations((0.0, 0.0, 0.0), (0.0, -10.0), [0.0] * 5, SCALAR)[1]
    assert ahead > 0
    assert starboard > 0


def test_turning_circles_grow_by_no_more_than_those_of_the_mmg_model_at_low_speed() -> None:
    """Tactical diameter at three tenths of the speed by that at full speed, within 15 % of the published model's."""
    model = published.kvlcc2_ship()
    truth = [trials.circle(model, speed=share * model.speed_mps, helm_deg=35.0) for share in (1.0, 0.3)]
    wanted = truth[1]["tactical_diameter_m"] / truth[0]["tactical_diameter_m"]
    vessel = vessel_of(TANKER, propellers(TANKER), NONE)
    fleet = Fleet(vessel, vessel.model.parameters[None], fastest_mps=30.0)
    mine = [
        fleet.results(Trial(kind="circle", speed_mps=share * model.speed_mps, angle_rad=math.radians(35.0)))
        for share in (1.0, 0.3)
    ]
    found = mine[1]["tactical_diameter_m"][0] / mine[0]["tactical_diameter_m"][0]
    assert found == pytest.approx(wanted, rel=0.15)


def test_parameters_do_not_depend_on_factors_of_what_the_ship_does_not_have() -> None:
    """A tanker without pods, tunnels or windage; an offshore vessel without rudders."""
    absent = {"side force of pods", "tunnel thrust", "wind ahead", "wind on the beam", "moment of wind"}
    base = parameters(TANKER, propellers(TANKER), NONE)
    for place, factor in enumerate(FACTORS):
        changed = parameters(TANKER, propellers(TANKER), np.eye(len(FACTORS))[place])
        assert (changed == base) == (factor.name in absent), factor.name
