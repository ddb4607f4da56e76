"""Forces of a ship from her particulars: published regressions, each with its source and its scatter.

The hull follows Yoshimura and Masumoto's regressions of the MMG model's derivatives; their cubic terms are projected
on second-order modulus terms over the drift and yaw rates of turns, together with the strips of cross-flow drag that
hold without headway, so that one set of terms holds from rest to full speed. What is not certain are `FACTORS`: each
multiplies one part of the forces, and its logarithm has the standard deviation stated.

Positive are forces ahead X and to starboard Y [N], and moments to starboard N about midships [N m].

Sources:
    Y. Yoshimura and Y. Masumoto, Hydrodynamic database and manoeuvring prediction method with medium high-speed
        merchant ships and fishing vessels, MARSIM 2012.
    H. Yasukawa and Y. Yoshimura, Introduction of MMG standard method for ship maneuvering predictions, J. Marine
        Science and Technology 20 (2015).
    D. Clarke, P. Gedling and G. Hine, The application of manoeuvring criteria in hull design using linear theory,
        Transactions RINA 125 (1983): added masses.
    F. H. Todd and ITTC 1957: friction line; H. E. Saunders and Denny-Mumford: wetted surface.
    E. V. Lewis (ed.), Principles of Naval Architecture II (1988): Taylor's wake fraction, propeller charts of the
        Wageningen B-series.
    H. Fujii and T. Tsuda, Experimental researches on rudder performance, J. SNAJ 110 (1961): lift slope.
    K. Kijima, T. Katsuno, Y. Nakiri and Y. Furukawa, On the manoeuvring performance of a ship with the parameter of
        loading condition, J. SNAJ 168 (1990); F. Quadvlieg, Workshop SIMMAN 2008: rudder-hull interaction.
    M. S. Chislett and O. Bjoerheden, Influence of ship speed on the effectiveness of a lateral thrust unit, HyA Report
        Hy-8 (1966): loss of tunnel thrusters.
    W. Blendermann, Parameter identification of wind loads on ships, J. Wind Engineering 51 (1994).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError
from expdesign.particulars.card import AIR_KGPM3, WATER_KGPM3, Card, Hull, Rudder, Thruster
from expdesign.values import Array

VISCOSITY_M2PS = 1.19e-6
G_MPS2 = 9.81
EFFICIENCY = 0.6
"""Resistance times speed by power on the shafts."""
FROUDE = 0.2
"""Froude number of a ship of which neither speed nor power is known."""
USUAL = {"block": (0.48, 0.88), "length by beam": (3.5, 8.5)}
"""Hulls that the regressions were made from, roughly; others have twice the scatter."""
BEYOND = 2.0


@dataclass(frozen=True)
class Factor:
    """Something that the regressions know only roughly: a part of the forces is multiplied by it."""

    name: str
    std_log: float  # standard deviation of its logarithm
    source: str  # of the value that it multiplies


FACTORS = (
    Factor("resistance", 0.25, "ITTC-57 friction with form factor and roughness, residual by Froude number"),
    Factor("added mass ahead", 0.30, "Soeding 1982, 2.7 rho volume^(5/3) / L^2"),
    Factor("added mass in sway", 0.20, "Clarke, Gedling and Hine 1983"),
    Factor("moment of inertia", 0.12, "radius of gyration L/4, added inertia by Clarke et al. 1983"),
    Factor("sway force of drift", 0.25, "Yoshimura and Masumoto 2012, Y_v"),
    Factor("sway force of turning", 0.50, "Yoshimura and Masumoto 2012, Y_r"),
    Factor("yaw moment of drift", 0.25, "Yoshimura and Masumoto 2012, N_v"),
    Factor("yaw damping", 0.25, "Yoshimura and Masumoto 2012, N_r"),
    Factor("nonlinear sway force", 0.35, "Yoshimura and Masumoto 2012, Y_vvv Y_vvr Y_vrr Y_rrr"),
    Factor("nonlinear yaw moment", 0.35, "Yoshimura and Masumoto 2012, N_vvv N_vvr N_vrr N_rrr"),
    Factor("cross-flow drag", 0.35, "strips of drag coefficient 0.8, Hooft 1994"),
    Factor("speed lost in turns", 0.40, "Yoshimura and Masumoto 2012, X_vr + m_y"),
    Factor("thrust at rest", 0.10, "Wageningen B-series, K_T = 0.44 (P/D)^1.15"),
    Factor("loss of thrust with speed", 0.15, "Wageningen B-series, zero thrust at J = 1.08 P/D"),
    Factor("thrust astern", 0.35, "six tenths of that ahead, Harvald 1976"),
    Factor("rudder force", 0.20, "Fujii 1961, with a_H of Quadvlieg 2013"),
    Factor("slipstream at the rudder", 0.35, "MMG standard method 2015, kappa of Yoshimura and Masumoto 2012"),
    Factor("straightened flow", 0.35, "Yoshimura and Masumoto 2012, gamma_R"),
    Factor("rudder drag", 0.40, "Yoshimura and Masumoto 2012, 1 - t_R = 0.61"),
    Factor("side force of pods", 0.50, "strut as a rudder of 0.4 D^2"),
    Factor("tunnel thrust", 0.25, "bollard pull of momentum theory, lost by Chislett and Bjoerheden 1966"),
    Factor("wind ahead", 0.25, "Blendermann 1994, 0.65"),
    Factor("wind on the beam", 0.15, "Blendermann 1994, 0.9"),
    Factor("moment of wind", 0.40, "Blendermann 1994, from the centre of the lateral area"),
)
"""Scatter as the regressions' own figures and the ships of `tests/benchmarks/particulars.py` show it."""
NAMES = tuple(factor.name for factor in FACTORS)
HULL = (
    "resistance", "added mass in sway", "moment of inertia", "sway force of drift", "sway force of turning",
    "yaw moment of drift", "yaw damping", "nonlinear sway force", "nonlinear yaw moment", "cross-flow drag",
    "speed lost in turns",
)  # fmt: skip
"""Factors of the hull's form."""


def is_usual(hull: Hull) -> bool:
    """Whether the regressions were made for such hulls: not for catamarans, barges or very fine forms."""
    values = {"block": hull.block, "length by beam": hull.length_m / hull.beam_m}
    return hull.hulls == 1 and all(low <= values[name] <= high for name, (low, high) in USUAL.items())


def scatter(hull: Hull) -> Array:
    """(f,) standard deviations of the factors' logarithms for a hull."""
    beyond = 1.0 if is_usual(hull) else BEYOND
    return np.array([one.std_log * (beyond if one.name in HULL else 1.0) for one in FACTORS])


def factors(hull: Hull, deviations: Array) -> dict[str, float]:
    """The factors of a hull, from their logarithms by standard deviation (f,)."""
    return dict(zip(NAMES, np.exp(deviations * scatter(hull)).tolist(), strict=True))


@dataclass(frozen=True, kw_only=True)
class Masses:
    """Mass and added mass, about midships."""

    surge_kg: float
    sway_kg: float
    yaw_kgm2: float
    coupling_kgm: float  # mass times the distance of its centre ahead of midships


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
        return (1.0 - self.deduction) * WATER_KGPM3 * self.diameter_m**4 * self.k_0

    @property
    def loss(self) -> float:
        """Loss of thrust per u n, less deduction [N s^2/m]."""
        return (1.0 - self.deduction) * WATER_KGPM3 * self.diameter_m**3 * self.k_1 * (1.0 - self.wake)

    @property
    def k_0(self) -> float:
        """Thrust coefficient at rest."""
        return 0.44 * self.pitch_ratio**1.15

    @property
    def k_1(self) -> float:
        """Its loss with the advance coefficient."""
        return self.k_0 / (1.08 * self.pitch_ratio)


def masses(hull: Hull, given: Mapping[str, float]) -> Masses:
    """Mass matrix about midships."""
    length, draught, mass = hull.length_m, hull.draught_m, hull.mass_kg
    slender = math.pi * (draught / length) ** 2 * WATER_KGPM3 / 2 * hull.hulls
    full = hull.block * hull.beam_m / draught
    narrow = hull.beam_m / length
    sway = slender * length**3 * max(1 + 0.16 * full - 5.1 * narrow**2, 0.5)
    yaw = slender * length**5 * max(1 / 12 + 0.017 * full - 0.33 * narrow, 0.03)
    ahead = 2.7 * WATER_KGPM3 * (mass / WATER_KGPM3 / hull.hulls) ** (5 / 3) / length**2 * hull.hulls
    own = mass * ((length / 4) ** 2 + hull.gravity_forward_m**2)
    return Masses(
        surge_kg=mass + given["added mass ahead"] * ahead,
        sway_kg=mass + given["added mass in sway"] * sway,
        yaw_kgm2=given["moment of inertia"] * (own + yaw),
        coupling_kgm=mass * hull.gravity_forward_m,
    )


def resistance(hull: Hull, speed_mps: float) -> float:
    """Resistance per u^2 at a speed [N s^2/m^2]."""
    reynolds = max(speed_mps * hull.length_m / VISCOSITY_M2PS, 1e5)
    friction = 0.075 / (math.log10(reynolds) - 2.0) ** 2 * (1.05 + 0.2 * hull.block)
    froude = min(speed_mps / math.sqrt(G_MPS2 * hull.length_m), 0.45)
    bulk = (5.5 * (hull.mass_kg / WATER_KGPM3 / hull.hulls) ** (1 / 3) / hull.length_m) ** 2  # 1 for usual ships
    rest = (0.0004 if hull.length_m > 20 else 0.0) + 0.0004 + 0.003 * bulk * (froude / 0.4) ** 4
    return WATER_KGPM3 / 2 * hull.wetted_m2 * (friction + rest)


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
        k = 0.44 * ratio**1.15 * (1.0 - inflow / (rps * diameter) / (1.08 * ratio))
        return WATER_KGPM3 * rps**2 * diameter**4 * k - needed

    rps = thruster.max_rps
    if rps is None and thruster.power_w is not None:
        ratio = pitch or 0.9
        rps = (thruster.power_w / (2 * math.pi * WATER_KGPM3 * diameter**5 * 0.045 * ratio**1.7)) ** (1 / 3)
    if rps is None:
        low, high = 0.01 * inflow / diameter, 20.0 * inflow / diameter
        rps = bisected(lambda value: missing(value, pitch or 0.9), low, high)
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


@dataclass(frozen=True, kw_only=True)
class Force:
    """What one expression contributes: its coefficients in surge, sway and yaw."""

    name: str  # ending of the parameters' names
    expression: str
    yaw_expression: str = ""  # in place of it in yaw
    x_n: float = 0.0
    y_n: float = 0.0
    n_nm: float = 0.0


def forces(card: Card, driving: tuple[Propeller, ...], given: Mapping[str, float]) -> Iterator[Force]:
    """All forces of the ship, as coefficients of expressions in the language of model terms."""
    fins = [*_rudder_fins(card, driving, given), *_pod_fins(card, driving, given)]
    yield from _hull(card.hull, design_speed(card), fins, given)
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


@dataclass(frozen=True)
class _Fin:
    """Something at the stern that resists sideways flow: force per u (v + reach r)."""

    force_n: float
    arm_m: float
    reach_m: float


def _hull(hull: Hull, speed: float, fins: list[_Fin], given: Mapping[str, float]) -> Iterator[Force]:
    """Resistance, drift, turning, and the Coriolis forces of the mass, about midships."""
    length, draught, block = hull.length_m, hull.draught_m, hull.block
    slim, deep = block * hull.beam_m / length, 2.0 * draught / length
    unit = WATER_KGPM3 / 2 * length * draught * hull.hulls  # N s^2/m^2
    ahead, sway = masses(hull, given).surge_kg, masses(hull, given).sway_kg
    yield Force(name="abs_u_u", expression="abs(u)*u", x_n=-given["resistance"] * resistance(hull, speed))
    turning = hull.mass_kg + unit * length * given["speed lost in turns"] * max(1.91 * slim - 0.08, 0.03)
    yield Force(name="vr", expression="v*r", x_n=min(turning, sway))
    yield Force(name="vv", expression="v*v", x_n=unit * min(1.15 * slim - 0.18, 0.0))
    yield Force(name="rr", expression="r*r", x_n=hull.mass_kg * hull.gravity_forward_m)
    fin = sum(one.force_n for one in fins), sum(one.force_n * one.reach_m for one in fins)
    fin_n = sum(one.force_n * one.arm_m for one in fins), sum(one.force_n * one.arm_m * one.reach_m for one in fins)
    sideways, turned = _modulus(hull, slim, deep, given)
    unit_n = unit * length
    yield Force(
        name="uv", expression="abs(u)*v", yaw_expression="u*v", y_n=unit * sideways[0] - fin[0],
        n_nm=unit_n * turned[0] - fin_n[0],
    )  # fmt: skip
    yield Force(
        name="ur", expression="u*r", yaw_expression="abs(u)*r", y_n=unit_n * sideways[1] - fin[1] - ahead,
        n_nm=unit_n * length * turned[1] - fin_n[1] - hull.mass_kg * hull.gravity_forward_m,
    )  # fmt: skip
    for name, expression, y, n, power in zip(
        ("abs_v_v", "abs_r_v", "abs_v_r", "abs_r_r"), ("abs(v)*v", "abs(r)*v", "abs(v)*r", "abs(r)*r"),
        sideways[2:], turned[2:], (0, 1, 1, 2), strict=True,
    ):  # fmt: skip
        yield Force(
            name=name, expression=expression, y_n=unit * length**power * y, n_nm=unit_n * length**power * n
        )


def _modulus(hull: Hull, slim: float, deep: float, given: Mapping[str, float]) -> tuple[list[float], list[float]]:
    """Nondimensional |u|v, |u|r, |v|v, |r|v, |v|r, |r|r of sway and yaw, those of turns and of cross-flow at rest.

    They are nearest to the regressions' cubics around the states of turns, where drift is about four tenths of the
    yaw rate r L / U, and to strips of cross-flow drag without headway.
    """
    block, ratio = hull.block, hull.length_m / hull.beam_m
    grids = np.meshgrid(np.radians(np.arange(-30.0, 31.0, 2.5)), np.arange(-1.0, 1.05, 0.1))
    drift, rate = (grid.ravel() for grid in grids)
    weight = np.exp(-(((drift - 0.42 * rate) / 0.12) ** 2) / 2) / (0.1 + rate**2) + 0.01
    u, v, r = np.cos(drift), -np.sin(drift), rate
    linear, cubes = np.stack([v, r], axis=1), np.stack([v**3, v * v * r, v * r * r, r**3], axis=1)
    sideways = linear @ [
        -(math.pi / 2 * deep + 1.4 * slim) * given["sway force of drift"],
        0.5 * slim * given["sway force of turning"],
    ] + given["nonlinear sway force"] * (
        cubes @ [-(0.185 * ratio + 0.48), -0.75, -(0.26 * (1 - block) * ratio + 0.11), -0.051]
    )  # fmt: skip
    turned = linear @ [
        -deep * given["yaw moment of drift"], -(0.54 * deep - deep**2) * given["yaw damping"]
    ] + given["nonlinear yaw moment"] * (
        cubes @ [0.69 * block - 0.66, 1.55 * slim - 0.76, 0.098 - 0.075 * (1 - block) * ratio, 0.25 * slim - 0.056]
    )  # fmt: skip
    angle = np.arange(0.0, 2 * math.pi, math.pi / 16)
    still_v, still_r = 0.5 * np.cos(angle), np.sin(angle)
    strips = np.linspace(-0.5, 0.5, 41)
    flow = still_v[:, None] + strips * still_r[:, None]
    drag = -0.8 * given["cross-flow drag"] * np.abs(flow) * flow
    rows = np.concatenate([_quadratic(u, v, r), _quadratic(0.0 * angle, still_v, still_r)])
    weights = np.sqrt(np.concatenate([weight / weight.sum(), np.full(len(angle), 0.05 / len(angle))]))[:, None]
    targets = np.stack([[*sideways, *drag.mean(axis=1)], [*turned, *(drag * strips).mean(axis=1)]], axis=1)
    found = np.linalg.lstsq(weights * rows, weights * targets, rcond=None)[0]
    return found[:, 0].tolist(), found[:, 1].tolist()


def _quadratic(u: Array, v: Array, r: Array) -> Array:
    return np.stack([np.abs(u) * v, np.abs(u) * r, *(np.abs(a) * b for b, a in ((v, v), (v, r), (r, v), (r, r)))], axis=1)


def _thrust(propeller: Propeller, given: Mapping[str, float]) -> Iterator[Force]:
    """Thrust ahead and astern, and its loss with speed, along the thruster's angle."""
    n, a, one = f"n{propeller.number}", f"a{propeller.number}", propeller.thruster
    gain = propeller.at_rest * given["thrust at rest"]
    loss = propeller.loss * given["loss of thrust with speed"] * given["thrust at rest"]
    back = 0.6 * given["thrust astern"] * gain
    if one.kind == "propeller":
        yield Force(
            name=n, expression=f"0.5*(abs({n})*{n}+{n}*{n})", x_n=gain, n_nm=-one.starboard_m * gain
        )
        yield Force(
            name=f"{n}_astern", expression=f"0.5*(abs({n})*{n}-{n}*{n})", x_n=back, n_nm=-one.starboard_m * back
        )
        yield Force(
            name=f"u{n}", expression=f"0.5*u*(abs({n})+{n})", x_n=-loss, n_nm=one.starboard_m * loss
        )
        return
    nominal = propeller.loss / propeller.at_rest
    yield Force(name=n, expression=f"abs({n})*{n}*cos({a})", x_n=gain)
    yield Force(name=f"u{n}", expression=f"u*abs({n})*cos({a})*cos({a})", x_n=-loss)
    thrust = f"(abs({n})*{n}-{nominal:.6g}*u*abs({n})*cos({a}))"
    yield Force(name=f"side_{n}", expression=f"{thrust}*sin({a})", y_n=gain)
    lever = f"({one.forward_m:.6g}*sin({a}){-one.starboard_m:+.6g}*cos({a}))" if one.starboard_m else f"{one.forward_m:.6g}*sin({a})"
    yield Force(name=f"turn_{n}", expression=f"{thrust}*{lever}", n_nm=gain)
    if one.forward_m < 0:
        side = _pod(propeller) * given["side force of pods"]
        yield Force(name=f"u{a}", expression=f"abs(u)*u*sin({a})", y_n=side, n_nm=one.forward_m * side)


def _pod(propeller: Propeller) -> float:
    """Side force of a pod's strut per u^2 and sine of its angle [N s^2/m^2]."""
    return WATER_KGPM3 / 2 * 0.4 * propeller.diameter_m**2 * 1.89 * (1.0 - propeller.wake) ** 2


def _pod_fins(card: Card, driving: tuple[Propeller, ...], given: Mapping[str, float]) -> Iterator[_Fin]:
    for one in driving:
        if one.thruster.kind != "propeller" and one.thruster.forward_m < 0:
            force = _pod(one) * given["side force of pods"] * 0.7
            yield _Fin(force, one.thruster.forward_m, one.thruster.forward_m * 1.6)


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
    yield Force(
        name=f"u{d}", expression=f"abs(u)*u*sin({d})*cos({d})", y_n=side * own, n_nm=side * own * arm
    )
    yield Force(name=f"drag_u{d}", expression=f"abs(u)*u*sin({d})*sin({d})", x_n=drag * own)
    if propeller is not None:
        n = f"n{propeller.number}"
        wash = (
            f"0.5*(abs({n})+{n})*({propeller.k_0 * propeller.diameter_m**2:.6g}*{n}"
            f"-{propeller.k_1 * (1.0 - propeller.wake) * propeller.diameter_m:.6g}*u)"
        )
        slip = flow.slip
        yield Force(
            name=f"{n}{d}", expression=f"{wash}*sin({d})*cos({d})", y_n=side * slip, n_nm=side * slip * arm
        )
        yield Force(name=f"drag_{n}{d}", expression=f"{wash}*sin({d})*sin({d})", x_n=drag * slip)


def _rudder_fins(card: Card, driving: tuple[Propeller, ...], given: Mapping[str, float]) -> Iterator[_Fin]:
    """Rudders amidships: the hull straightens the flow that meets them."""
    gamma = 2.06 * card.hull.block * card.hull.beam_m / card.hull.length_m + 0.14
    for rudder in card.rudders:
        flow = _inflow(card, rudder, _ahead_of(rudder, driving), given)
        lift, with_hull, arm = _lift(card, rudder, given)
        force = lift * with_hull * gamma * given["straightened flow"] * flow.speed
        yield _Fin(force, arm, -0.9 * card.hull.length_m)


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
    return Force(
        name=n, expression=f"0.5*{n}*({left}+abs{left})", y_n=gain, n_nm=gain * thruster.forward_m
    )


def tunnel(thruster: Thruster, card: Card) -> tuple[float, float, float]:
    """Diameter [m], power [W] and full shaft speed [rps] of a tunnel thruster, those that are not stated as usual."""
    diameter = thruster.diameter_m or 0.35 * card.hull.draught_m
    power = thruster.power_w or 250e3 * diameter**2  # usual loading, 250 kW/m2
    return diameter, power, thruster.max_rps or 8.0 / diameter
