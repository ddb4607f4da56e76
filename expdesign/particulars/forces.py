"""Forces of thrusters, rudders and wind from particulars, with the hull's: coefficients of expressions of model terms.

Thrust is K_T rho n^2 D^4, with K_T linear in the advance coefficient; a rudder has Fujii's lift in the flow that hull
and slipstream send past it, and its slipstream's square grows with the thrust. Signs and units are those of
`expdesign.particulars.hull`.

Sources:
    H. Yasukawa and Y. Yoshimura, Introduction of MMG standard method for ship maneuvering predictions, J. Marine
        Science and Technology 20 (2015).
    Y. Yoshimura and Y. Masumoto, MARSIM 2012: kappa, gamma_R, t_R. F. Quadvlieg, Mathematical models for the prediction
        of manoeuvres, MARIN (2013): a_H. H. Fujii and T. Tsuda, Experimental researches on rudder performance, J. SNAJ
        110 (1961): lift slope.
    E. V. Lewis (ed.), Principles of Naval Architecture II (1988): Taylor's wake fraction, propeller charts of the
        Wageningen B-series.
    M. S. Chislett and O. Bjoerheden, Influence of ship speed on the effectiveness of a lateral thrust unit, HyA Report
        Hy-8 (1966): loss of tunnel thrusters.
    W. Blendermann, Parameter identification of wind loads on ships, J. Wind Engineering 51 (1994).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from expdesign.errors import InputError
from expdesign.particulars.card import AIR_KGPM3, WATER_KGPM3, Card, Rudder, Thruster
from expdesign.particulars.hull import Fin, Force, hull_forces, resistance
from expdesign.waves import G_MPS2

EFFICIENCY = 0.6  # resistance times speed by power on the shafts
USUAL_PITCH = 0.9  # pitch by diameter of a propeller of which only the power or the top speed is known
FROUDE = 0.2  # Froude number of a ship of which neither speed nor power is known


@dataclass(frozen=True, kw_only=True)
class Propeller:
    """A thruster with everything that a card may leave out."""

    number: str  # in the names of its signals
    thruster: Thruster
    diameter_m: float
    max_rps: float
    pitch_ratio: float
    wake: float
    deduction: float
    design_mps: float  # speed at which its slipstream is matched

    @property
    def at_rest(self) -> float:
        """Thrust per n^2 at rest, less deduction [N s^2]."""
        return float((1.0 - self.deduction) * WATER_KGPM3 * self.diameter_m**4 * self.k_0)

    @property
    def loss(self) -> float:
        """Loss of thrust per u n, less deduction [N s^2/m]."""
        return (1.0 - self.deduction) * WATER_KGPM3 * self.diameter_m**3 * self.k_1 * (1.0 - self.wake)

    @property
    def k_0(self) -> float:
        """Thrust coefficient at rest."""
        return open_water(self.pitch_ratio)[0]

    @property
    def k_1(self) -> float:
        """Its loss with the advance coefficient."""
        return open_water(self.pitch_ratio)[1]


def open_water(pitch_ratio: float) -> tuple[float, float]:
    """Thrust coefficient at rest and its loss with the advance coefficient, four blades of the B-series."""
    at_rest = float(0.44 * pitch_ratio**1.15)
    return at_rest, at_rest / (1.08 * pitch_ratio)


def full_rps(power_w: float, diameter_m: float, pitch_ratio: float) -> float:
    """Shaft speed of a power under way, with a torque coefficient of three quarters of that at rest."""
    torque = 0.045 * pitch_ratio**1.7
    return float((power_w / (2 * math.pi * WATER_KGPM3 * diameter_m**5 * torque)) ** (1 / 3))


def design_speed(card: Card) -> float:
    """Speed at full order [m/s]: stated, or that which the power gives, or of the fastest trial, or a Froude number."""
    if card.top_speed_mps:
        return card.top_speed_mps
    reached = [one.value / one.trial.order for one in card.stated if one.quantity == "speed_mps"]
    if reached:
        return max(reached)
    if all(one.power_w for one in card.drives):
        power = EFFICIENCY * sum(one.power_w or 0.0 for one in card.drives)
        return bisected(lambda speed: resistance(card.hull, speed) * speed**3 - power, 0.1, 50.0)
    fastest = [one.trial.speed_mps for one in card.stated if one.trial.kind != "drift"]
    return max(fastest, default=0.0) or FROUDE * math.sqrt(G_MPS2 * card.hull.length_m)


def propellers(card: Card) -> tuple[Propeller, ...]:
    """Every thruster that drives ahead, completed: what is not stated follows from speed, power and draught.

    Raises:
        InputError: none drives ahead.
    """
    drives = card.drives
    if not drives:
        raise InputError(f"ship {card.name!r} has no propeller, azimuth thruster or pod to drive her, expected one")
    speed = design_speed(card)
    many = len(drives)
    wake = max(0.5 * card.hull.block - 0.05, 0.05) if many == 1 else max(0.55 * card.hull.block - 0.20, 0.02)
    deduction = 0.6 * wake if many == 1 else 0.05 + 0.6 * wake
    needed = resistance(card.hull, speed) * speed**2 / many / (1.0 - deduction)
    return tuple(
        _completed(card, number, needed=needed, speed=speed, wake=wake, deduction=deduction)
        for number, one in enumerate(card.thrusters)
        if one.drives
    )


def _completed(card: Card, number: int, *, needed: float, speed: float, wake: float, deduction: float) -> Propeller:
    thruster = card.thrusters[number]
    diameter = thruster.diameter_m or (0.65 if len(card.drives) == 1 else 0.55) * card.hull.draught_m
    pitch = thruster.pitch_ratio
    inflow = (1.0 - wake) * speed

    def missing(rps: float, ratio: float) -> float:
        """Thrust less what is needed at the design speed."""
        k_0, k_1 = open_water(ratio)
        return WATER_KGPM3 * rps**2 * diameter**4 * (k_0 - k_1 * inflow / (rps * diameter)) - needed

    rps = thruster.max_rps
    if rps is None and thruster.power_w is not None:
        rps = full_rps(thruster.power_w, diameter, pitch or USUAL_PITCH)
    if rps is None:
        low, high = 0.01 * inflow / diameter, 20.0 * inflow / diameter
        rps = bisected(lambda value: missing(value, pitch or USUAL_PITCH), low, high)
    if pitch is None:
        pitch = bisected(lambda ratio: missing(rps, ratio), 0.4, 1.6)
    return Propeller(
        number=str(number + 1), thruster=thruster, diameter_m=diameter, max_rps=rps, pitch_ratio=pitch, wake=wake,
        deduction=deduction, design_mps=speed,
    )  # fmt: skip


def bisected(curve: Callable[[float], float], low: float, high: float) -> float:
    """Where a rising function crosses zero; the nearer end where it does not."""
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if curve(middle) > 0 else (middle, high)
    return (low + high) / 2


def forces(card: Card, driving: tuple[Propeller, ...], given: Mapping[str, float]) -> Iterator[Force]:
    """All forces of the ship, as coefficients of expressions in the language of model terms."""
    fins = [*_rudder_fins(card, driving, given), *_pod_fins(card, driving, given)]
    yield from hull_forces(card.hull, design_speed(card), fins, given)
    for propeller in driving:
        yield from _thrust(propeller, given)
    for number, rudder in enumerate(card.rudders, start=1):
        yield from _rudder(card, rudder, str(number), _ahead_of(rudder, driving), given)
    for number, thruster in enumerate(card.thrusters, start=1):
        if not thruster.drives:
            yield _tunnel(thruster, card, str(number), given)
    if card.windage is not None:
        frontal, lateral = (AIR_KGPM3 / 2 * a for a in (card.windage.frontal_m2, card.windage.lateral_m2))
        arm = card.windage.centre_forward_m + card.hull.length_m * 0.05
        yield Force(name="wind_u", expression="abs(u_q)*u_q", x_n=-0.65 * frontal * given["wind ahead"])
        beam = -0.9 * lateral * given["wind on the beam"]
        yield Force(name="wind_v", expression="abs(v_q)*v_q", y_n=beam, n_nm=beam * card.windage.centre_forward_m)
        yield Force(name="wind_uv", expression="u_q*v_q", n_nm=-0.9 * lateral * arm * given["moment of wind"])


def _thrust(propeller: Propeller, given: Mapping[str, float]) -> Iterator[Force]:
    """Thrust ahead and astern, and its loss with speed, along the thruster's angle."""
    n, a, one = f"n{propeller.number}", f"a{propeller.number}", propeller.thruster
    gain = propeller.at_rest * given["thrust at rest"]
    loss = propeller.loss * given["loss of thrust with speed"] * given["thrust at rest"]
    back = 0.6 * given["thrust astern"] * gain
    if one.kind == "propeller":
        yield Force(name=n, expression=f"0.5*(abs({n})*{n}+{n}*{n})", x_n=gain, n_nm=-one.starboard_m * gain)
        yield Force(
            name=f"{n}_astern", expression=f"0.5*(abs({n})*{n}-{n}*{n})", x_n=back, n_nm=-one.starboard_m * back
        )
        yield Force(name=f"u{n}", expression=f"0.5*u*(abs({n})+{n})", x_n=-loss, n_nm=one.starboard_m * loss)
        return
    nominal = propeller.loss / propeller.at_rest
    yield Force(name=n, expression=f"abs({n})*{n}*cos({a})", x_n=gain)
    yield Force(name=f"u{n}", expression=f"u*abs({n})*cos({a})*cos({a})", x_n=-loss)
    thrust = f"(abs({n})*{n}-{nominal:.6g}*u*abs({n})*cos({a}))"
    yield Force(name=f"side_{n}", expression=f"{thrust}*sin({a})", y_n=gain)
    lever = (
        f"({one.forward_m:.6g}*sin({a}){-one.starboard_m:+.6g}*cos({a}))"
        if one.starboard_m
        else f"{one.forward_m:.6g}*sin({a})"
    )
    yield Force(name=f"turn_{n}", expression=f"{thrust}*{lever}", n_nm=gain)
    if one.forward_m < 0:
        side = _pod(propeller) * given["side force of pods"]
        yield Force(name=f"u{a}", expression=f"abs(u)*u*sin({a})", y_n=side, n_nm=one.forward_m * side)


def _pod(propeller: Propeller) -> float:
    """Side force of a pod's strut per u^2 and sine of its angle [N s^2/m^2]."""
    return WATER_KGPM3 / 2 * 0.4 * propeller.diameter_m**2 * 1.89 * (1.0 - propeller.wake) ** 2


def _pod_fins(card: Card, driving: tuple[Propeller, ...], given: Mapping[str, float]) -> Iterator[Fin]:
    for one in driving:
        if one.thruster.kind != "propeller" and one.thruster.forward_m < 0:
            force = _pod(one) * given["side force of pods"] * 0.7
            yield Fin(force, one.thruster.forward_m, one.thruster.forward_m * 1.6)


def _ahead_of(rudder: Rudder, driving: tuple[Propeller, ...]) -> Propeller | None:
    """The propeller whose slipstream meets a rudder: on its side of the ship, or none."""
    fixed = [one for one in driving if one.thruster.kind == "propeller" and one.thruster.forward_m < 0]
    near = min(fixed, key=lambda one: abs(one.thruster.starboard_m - rudder.starboard_m), default=None)
    if near is None or abs(near.thruster.starboard_m - rudder.starboard_m) > near.diameter_m / 2:
        return None
    return near


@dataclass(frozen=True)
class _Inflow:
    """Flow past a rudder: its square per u^2 and per slipstream, and its speed by u in a turn."""

    own: float
    slip: float  # per n (k_0 n - k_1 (1 - w) u / D) D^2, 0 without propeller
    speed: float


def _inflow(card: Card, rudder: Rudder, propeller: Propeller | None, given: Mapping[str, float]) -> _Inflow:
    if propeller is None:
        wake = propellers(card)[0].wake / 2
        return _Inflow((1.0 - wake) ** 2, 0.0, 1.0 - wake)
    own = 1.0 - 0.5 * propeller.wake  # half of the wake is left in turns
    share = min(propeller.diameter_m / math.sqrt(rudder.area_m2 * rudder.aspect_ratio), 1.0)
    kappa = max(0.55 - 0.8 * card.hull.block * card.hull.beam_m / card.hull.length_m, 0.3)
    u = 0.75 * propeller.design_mps  # in a turn
    n, d = propeller.max_rps, propeller.diameter_m
    loading = max(8 / math.pi * d * n * (propeller.k_0 * n * d - propeller.k_1 * own * u) / (own * u) ** 2, 0.1)
    gain = ((1.0 + kappa * (math.sqrt(1.0 + loading) - 1.0)) ** 2 - 1.0) / loading
    slip = share * gain * 8 / math.pi * given["slipstream at the rudder"]
    return _Inflow(own**2, slip, own * math.sqrt(1.0 + share * gain * loading * given["slipstream at the rudder"]))


def _lift(card: Card, rudder: Rudder, given: Mapping[str, float]) -> tuple[float, float, float]:
    """Force per squared inflow [N s^2/m^2], its share with the hull's, and the arm of both [m]."""
    slope = 6.13 * rudder.aspect_ratio / (2.25 + rudder.aspect_ratio)
    lift = WATER_KGPM3 / 2 * rudder.area_m2 * slope * given["rudder force"]
    share = max(0.627 * card.hull.block - 0.153, 0.05)
    arm = (rudder.forward_m - share * 0.42 * card.hull.length_m) / (1.0 + share)
    return lift, 1.0 + share, arm


def _rudder(
    card: Card, rudder: Rudder, number: str, propeller: Propeller | None, given: Mapping[str, float]
) -> Iterator[Force]:
    flow = _inflow(card, rudder, propeller, given)
    lift, with_hull, arm = _lift(card, rudder, given)
    d = f"rudder{number}"
    side, drag = -lift * with_hull, -0.61 * lift * given["rudder drag"]
    own = flow.own
    yield Force(name=f"u{d}", expression=f"abs(u)*u*sin({d})*cos({d})", y_n=side * own, n_nm=side * own * arm)
    yield Force(name=f"drag_u{d}", expression=f"abs(u)*u*sin({d})*sin({d})", x_n=drag * own)
    if propeller is not None:
        n = f"n{propeller.number}"
        wash = (
            f"0.5*(abs({n})+{n})*({propeller.k_0 * propeller.diameter_m**2:.6g}*{n}"
            f"-{propeller.k_1 * (1.0 - propeller.wake) * propeller.diameter_m:.6g}*u)"
        )
        slip = flow.slip
        yield Force(name=f"{n}{d}", expression=f"{wash}*sin({d})*cos({d})", y_n=side * slip, n_nm=side * slip * arm)
        yield Force(name=f"drag_{n}{d}", expression=f"{wash}*sin({d})*sin({d})", x_n=drag * slip)


def _rudder_fins(card: Card, driving: tuple[Propeller, ...], given: Mapping[str, float]) -> Iterator[Fin]:
    """Rudders at zero helm: the hull straightens the flow that meets them."""
    gamma = 2.06 * card.hull.block * card.hull.beam_m / card.hull.length_m + 0.14
    for rudder in card.rudders:
        flow = _inflow(card, rudder, _ahead_of(rudder, driving), given)
        lift, with_hull, arm = _lift(card, rudder, given)
        force = lift * with_hull * gamma * given["straightened flow"] * flow.speed
        yield Fin(force, arm, -0.9 * card.hull.length_m)


def bollard_n(power_w: float, diameter_m: float) -> float:
    """Thrust at rest of a power [N]: eight tenths of momentum theory."""
    return 0.8 * float((math.pi / 2 * WATER_KGPM3 * (power_w * diameter_m) ** 2) ** (1 / 3))


def _tunnel(thruster: Thruster, card: Card, number: str, given: Mapping[str, float]) -> Force:
    """A tunnel thruster: its thrust fades with the ship's speed, and is gone at six tenths of its jet's."""
    diameter, power, rps = tunnel(thruster, card)
    thrust = bollard_n(power, diameter)
    jet = math.sqrt(thrust / (WATER_KGPM3 * math.pi / 4 * diameter**2))
    n, lost = f"n{number}", rps / (0.6 * jet)
    left = f"(abs({n})-{lost:.6g}*abs(u))"
    gain = thrust / rps**2 * given["tunnel thrust"]
    return Force(name=n, expression=f"0.5*{n}*({left}+abs{left})", y_n=gain, n_nm=gain * thruster.forward_m)


def tunnel(thruster: Thruster, card: Card) -> tuple[float, float, float]:
    """Diameter [m], power [W] and full shaft speed [rps] of a tunnel thruster, those that are not stated as usual."""
    diameter = thruster.diameter_m or 0.35 * card.hull.draught_m
    power = thruster.power_w or 250e3 * diameter**2  # usual loading, 250 kW/m2
    return diameter, power, thruster.max_rps or 8.0 / diameter
