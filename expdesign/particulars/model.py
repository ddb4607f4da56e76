"""From forces to a vessel: accelerations that are linear in parameters, on terms of the existing language."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from expdesign.particulars.card import Card, Thruster
from expdesign.particulars.forces import Propeller, design_speed, forces, tunnel
from expdesign.particulars.hull import FACTORS, Force, factors, masses
from expdesign.values import Array
from expdesign.vessel import Actuator, Limit, Response, Term, Vessel, VesselModel

EQUATIONS = {"u": "X", "v": "Y", "r": "N"}
SAMPLES = 8  # while she sails her length
OWN_SCATTER = 0.03
"""Standard deviation of each parameter by itself, by its value: what a projection on few terms leaves out."""
RANGES = (
    (re.compile(r"X_abs_u_u|Y_uv|Y_abs_v_v|N_ur|N_abs_r_r|W_wind_[uv]"), (-math.inf, 0.0)),  # damping and drag
    (re.compile(r"X_un\d+|X_drag_\w+|Y_(u|n\d+)rudder\d+"), (-math.inf, 0.0)),  # loss of thrust, rudders
    (re.compile(r"X_n\d+(_astern)?|Y_(side_)?n\d+"), (0.0, math.inf)),  # thrust
)
"""Parameters whose sign physics gives: a hull that is driven by its own drag runs away. Not of a force that acts in an
equation by the coupling of sway and yaw alone."""
STEERING = re.compile(r"[YN]_ua\d+|N_(u|n\d+)rudder\d+|N_turn_n\d+|N_n\d+")
"""Parameters that keep their sign, which place and side of the actuator give: a helm turns her to its side."""


def parameters(card: Card, driving: tuple[Propeller, ...], deviations: Array) -> dict[Term, float]:
    """Terms with their parameters, for factors by `deviations` (f,) of their logarithms.

    Sway and yaw are coupled where the centre of gravity is not amidships; the inverse of the mass matrix goes into the
    parameters, as both equations have the same terms.
    """
    given = factors(card.hull, deviations)
    mass = masses(card.hull, given)
    inverse = np.linalg.inv([[mass.sway_kg, mass.coupling_kgm], [mass.coupling_kgm, mass.yaw_kgm2]])
    found: dict[Term, float] = {}
    for force in forces(card, driving, given):
        sway, yaw = (inverse @ [force.y_n, force.n_nm]).tolist()
        for equation, value in (("u", force.x_n / mass.surge_kg), ("v", sway), ("r", yaw)):
            if value:
                found[_term(equation, force)] = value
    return found


def _term(equation: str, force: Force) -> Term:
    letter = "W" if force.name.startswith("wind") and equation != "r" else EQUATIONS[equation]
    expression = force.yaw_expression if equation == "r" and force.yaw_expression else force.expression
    return Term(equation, f"{letter}_{force.name}", expression)


def actuators(card: Card, driving: tuple[Propeller, ...]) -> tuple[Actuator, ...]:
    """Thrusters and rudders with limits and slew rates."""
    full = {one.number: one.max_rps for one in driving}
    found = []
    for number, thruster in enumerate(card.thrusters, start=1):
        rps = full.get(str(number)) or tunnel(thruster, card)[2]
        found.append(_thruster(thruster, number, rps))
    for number, rudder in enumerate(card.rudders, start=1):
        most = rudder.angle_max_rad
        found.append(
            Actuator(
                kind="rudder", number=number, forward_m=rudder.forward_m, starboard_m=rudder.starboard_m,
                limits=(Limit(low=-most, high=most),), responses=(Response(rate=rudder.angle_rate_radps),),
            )
        )  # fmt: skip
    return tuple(found)


def _thruster(thruster: Thruster, number: int, rps: float) -> Actuator:
    astern = rps if thruster.kind == "tunnel" else rps * thruster.astern_share
    limits = [Limit(low=0.0 - astern, high=rps)]
    responses = [Response(rate=rps / thruster.full_order_s)]
    if thruster.kind in ("azimuth", "podded"):
        most = math.inf if thruster.angle_max_rad is None else thruster.angle_max_rad
        limits.append(Limit(low=-most, high=most))
        responses.append(Response(rate=thruster.angle_rate_radps))
    kind = "azimuth" if thruster.kind == "podded" else thruster.kind
    return Actuator(
        kind=kind, number=number, forward_m=thruster.forward_m, starboard_m=thruster.starboard_m,
        limits=tuple(limits), responses=tuple(responses),
    )  # fmt: skip


def sample_time(card: Card) -> float:
    """Time between samples [s]: about an eighth of the time in which she sails her length.

    Motion is integrated in smaller steps, so this only says how often commands and measurements come.
    """
    usual = (0.1, 0.2, 0.5, 1.0, 2.0)
    return min(usual, key=lambda step: abs(math.log(step * SAMPLES * design_speed(card) / card.hull.length_m)))


def _ranges(card: Card, driving: tuple[Propeller, ...], found: Mapping[Term, float]) -> dict[str, tuple[float, float]]:
    """Ranges of parameters that keep their sign."""
    steering = {term.name: value for term, value in found.items() if STEERING.fullmatch(term.name) and value}
    sides = {name: (0.0, math.inf) if value > 0.0 else (-math.inf, 0.0) for name, value in steering.items()}
    acting = {
        _term(equation, force).name
        for force in forces(card, driving, factors(card.hull, np.zeros(len(FACTORS))))
        for equation, own in (("u", force.x_n), ("v", force.y_n), ("r", force.n_nm))
        if own
    }
    physics = {name: ends for name in acting for names, ends in RANGES if names.fullmatch(name)}
    return sides | {term.name: physics[term.name] for term in found if term.name in physics}


def vessel_of(card: Card, driving: tuple[Propeller, ...], deviations: Array) -> Vessel:
    """The vessel with these factors, parameters without scatter."""
    found = parameters(card, driving, deviations)
    step = sample_time(card)
    hull = card.hull
    model = VesselModel(
        terms=tuple(found), parameters=np.array([*found.values()]), parameter_std=np.zeros(len(found)),
        form="continuous", sample_time_s=step, actuators=actuators(card, driving),
        parameter_range=_ranges(card, driving, found),
    )  # fmt: skip
    return Vessel(
        name=card.name, length_m=hull.length_m, beam_m=hull.over_all_m or hull.beam_m, draught_m=hull.draught_m,
        sample_time_s=step, model=model,
    )  # fmt: skip


def with_scatter(vessel: Vessel, slopes: Array, covariance: Array) -> Vessel:
    """The vessel whose parameters have a covariance: that of the factors, and a scatter of their own.

    Args:
        slopes: (p, f) of parameters by deviations.
        covariance: (f, f) of the deviations.
    """
    model = vessel.model
    own = np.diag((OWN_SCATTER * model.parameters) ** 2)
    return replace(vessel, model=model.with_covariance(model.names, slopes @ covariance @ slopes.T + own))
