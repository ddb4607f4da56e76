"""Forces of a hull from her particulars: published regressions, each with its source and its scatter.

They follow Yoshimura and Masumoto's regressions of the MMG model's derivatives; their cubic terms are projected on
second-order modulus terms over the drift and yaw rates of turns, together with the strips of cross-flow drag that hold
without headway, so that one set of terms holds from rest to full speed. What is not certain are `FACTORS`: each
multiplies one part of the forces, and its logarithm has the standard deviation stated.

Positive are forces ahead X and to starboard Y [N], and moments to starboard N about midships [N m].

Sources:
    Y. Yoshimura and Y. Masumoto, Hydrodynamic database and manoeuvring prediction method with medium high-speed
        merchant ships and fishing vessels, MARSIM 2012.
    D. Clarke, P. Gedling and G. Hine, The application of manoeuvring criteria in hull design using linear theory,
        Transactions RINA 125 (1983): added masses.
    ITTC 1957: friction line. Denny and Mumford: wetted surface. J. P. Hooft, The cross-flow drag on a manoeuvring ship,
        Ocean Engineering 21 (1994).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.particulars.card import WATER_KGPM3, Hull
from expdesign.values import Array
from expdesign.waves import G_MPS2

VISCOSITY_M2PS = 1.19e-6
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
"""The standard deviations are judgements, scaled so that predictions of the published ships of
`tests/benchmarks/particulars.py` deviate by one of their own standard deviations in the mean square."""
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
class Force:
    """What one expression contributes: its coefficients in surge, sway and yaw."""

    name: str  # ending of the parameters' names
    expression: str
    yaw_expression: str = ""  # in place of it in yaw
    x_n: float = 0.0
    y_n: float = 0.0
    n_nm: float = 0.0


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


def ittc_57(reynolds: float) -> float:
    """Friction coefficient."""
    return float(0.075 / (math.log10(reynolds) - 2.0) ** 2)


def resistance(hull: Hull, speed_mps: float) -> float:
    """Resistance per u^2 at a speed [N s^2/m^2]."""
    reynolds = max(speed_mps * hull.length_m / VISCOSITY_M2PS, 1e5)
    friction = (1.05 + 0.2 * hull.block) * ittc_57(reynolds)
    froude = min(speed_mps / math.sqrt(G_MPS2 * hull.length_m), 0.45)
    bulk = (5.5 * (hull.mass_kg / WATER_KGPM3 / hull.hulls) ** (1 / 3) / hull.length_m) ** 2  # 1 for usual ships
    rest = (0.0004 if hull.length_m > 20 else 0.0) + 0.0004 + 0.003 * bulk * (froude / 0.4) ** 4
    return float(WATER_KGPM3 / 2 * hull.wetted_m2 * (friction + rest))


@dataclass(frozen=True)
class Fin:
    """Something at the stern that resists sideways flow: force per u (v + reach r)."""

    force_n: float
    arm_m: float
    reach_m: float


def hull_forces(hull: Hull, speed: float, fins: list[Fin], given: Mapping[str, float]) -> Iterator[Force]:
    """Resistance, drift, turning, and the Coriolis forces of the mass, about midships."""
    length = hull.length_m
    slim = hull.block * hull.beam_m / length
    unit = WATER_KGPM3 / 2 * length * hull.draught_m * hull.hulls  # N s^2/m^2
    ahead, sway = masses(hull, given).surge_kg, masses(hull, given).sway_kg
    yield Force(name="abs_u_u", expression="abs(u)*u", x_n=-given["resistance"] * resistance(hull, speed))
    turning = hull.mass_kg + unit * length * given["speed lost in turns"] * max(1.91 * slim - 0.08, 0.03)
    yield Force(name="vr", expression="v*r", x_n=min(turning, sway))
    yield Force(name="vv", expression="v*v", x_n=unit * min(1.15 * slim - 0.18, 0.0))
    yield Force(name="rr", expression="r*r", x_n=hull.mass_kg * hull.gravity_forward_m)
    fin = sum(one.force_n for one in fins), sum(one.force_n * one.reach_m for one in fins)
    fin_n = sum(one.force_n * one.arm_m for one in fins), sum(one.force_n * one.arm_m * one.reach_m for one in fins)
    sideways, turned = modulus(hull, given)
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
        yield Force(name=name, expression=expression, y_n=unit * length**power * y, n_nm=unit_n * length**power * n)


def derivatives(hull: Hull) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Y' and N' of v, r, vvv, vvr, vrr, rrr by Yoshimura and Masumoto, by rho/2 L T U^2 and rho/2 L^2 T U^2."""
    block, ratio = hull.block, hull.length_m / hull.beam_m
    slim, deep = block / ratio, 2.0 * hull.draught_m / hull.length_m
    sway = (
        -(math.pi / 2 * deep + 1.4 * slim), 0.5 * slim,
        -(0.185 * ratio + 0.48), -0.75, -(0.26 * (1 - block) * ratio + 0.11), -0.051,
    )  # fmt: skip
    yaw = (
        -deep, -(0.54 * deep - deep**2),
        0.69 * block - 0.66, 1.55 * slim - 0.76, 0.098 - 0.075 * (1 - block) * ratio, 0.25 * slim - 0.056,
    )  # fmt: skip
    return sway, yaw


def modulus(hull: Hull, given: Mapping[str, float]) -> tuple[list[float], list[float]]:
    """Nondimensional |u|v, |u|r, |v|v, |r|v, |v|r, |r|r of sway and yaw, those of turns and of cross-flow at rest.

    They are nearest to the regressions' cubics around the states of turns, where drift is about four tenths of the
    yaw rate r L / U, and to strips of cross-flow drag without headway.
    """
    grids = np.meshgrid(np.radians(np.arange(-30.0, 31.0, 2.5)), np.arange(-1.0, 1.05, 0.1))
    drift, rate = (grid.ravel() for grid in grids)
    weight = np.exp(-(((drift - 0.42 * rate) / 0.12) ** 2) / 2) / (0.1 + rate**2) + 0.01
    u, v, r = np.cos(drift), -np.sin(drift), rate
    terms = np.stack([v, r, v**3, v * v * r, v * r * r, r**3], axis=1)
    names = (
        ("sway force of drift", "sway force of turning", *["nonlinear sway force"] * 4),
        ("yaw moment of drift", "yaw damping", *["nonlinear yaw moment"] * 4),
    )
    sideways, turned = (
        terms @ [value * given[name] for value, name in zip(values, parts, strict=True)]
        for values, parts in zip(derivatives(hull), names, strict=True)
    )
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
    return np.stack(
        [np.abs(u) * v, np.abs(u) * r, *(np.abs(a) * b for b, a in ((v, v), (v, r), (r, v), (r, r)))], axis=1
    )
