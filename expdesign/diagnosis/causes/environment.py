"""Causes in water and air."""

from __future__ import annotations

import math
from collections.abc import Mapping, Set

import numpy as np

from expdesign.diagnosis.causes.candidate import Candidate, Cause, Situation, Values, listed, rounded
from expdesign.diagnosis.causes.hull import absent_terms
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel, own_air_terms


def _candidates_current(situation: Situation) -> tuple[Candidate, ...]:
    if not situation.windows.has_heading:
        return ()
    return (Candidate(cause="current", free={"current:north": 0.0, "current:east": 0.0}),)


def _explain_current(values: Values, _ship: ExtendedModel) -> str:
    (north, _), (east, _) = values["current:north"], values["current:east"]
    toward = math.degrees(math.atan2(east, north)) % 360
    return (
        f"The error depends on the heading as in moving water. It corresponds to a steady current of "
        f"{math.hypot(north, east):.2f} m/s towards {toward:.0f} degrees "
        f"(north {rounded(*values['current:north'])}, east {rounded(*values['current:east'])} m/s)."
    )


CURRENT = Cause(
    name="current",
    title="Current",
    missing="a current",
    summary="a steady current",
    candidates=_candidates_current,
    explain=_explain_current,
    unseen="no heading is measured",
)

LEAST_VARIATION = 0.01


def _candidates_shallow_water(situation: Situation) -> tuple[Candidate, ...]:
    windows = situation.windows
    if not windows.has_depth or any(key.startswith("shallow:") for key in situation.ship.effects):
        return ()
    shoal = situation.ship.draught_m / windows.depth_m
    if np.ptp(shoal) < LEAST_VARIATION:
        return ()
    groups = (("damping",), ("inertia",), ("damping", "inertia"))
    return tuple(Candidate(cause="shallow_water", free={f"shallow:{n}": 0.0 for n in group}) for group in groups)


def _explain_shallow_water(values: Values, _ship: ExtendedModel) -> str:
    half = ", ".join(
        f"{key.split(':')[1]} by {rounded(50 * value, 50 * std)} %" for key, (value, std) in values.items()
    )
    return f"The motion depends on the water depth. A depth of twice the draught increases {half}."


SHALLOW_WATER = Cause(
    name="shallow_water",
    title="Shallow water",
    missing="shallow water",
    summary="shallow water: damping and inertia grow with draught over depth",
    candidates=_candidates_shallow_water,
    explain=_explain_shallow_water,
    unseen="no depth is recorded",
)

ASSUMED_MPS, SECTORS, FINER = 10.0, 8, 7
"""For a wind that is not measured: assumed speed, number of directions tried, and steps within each sector."""
AHEAD, ASIDE, TURNING = "term:W_abs_u_u", "term:W_abs_v_v", "term:W_uv"
LEAST_TURN_RAD = math.pi / 4
"""Greatest turn from the mean heading, at least, for a wind that is not measured: on one course it is a constant force
and a constant moment, as an offset of the rudder, a bias of the compass and a current are, with fewer numbers."""
MOST_AHEAD = 2.0
"""Drag coefficient ahead over the one aside, at most: no ship shows the air more of her front than of her side, and her
inertia ahead is at least half of that aside."""
MOST_TURNING = 16.0
"""Coefficient of the yaw moment over that of the side force, times the length, at most: the side force acts somewhere
along the hull, half a length from amidships at most, and inertia aside over that in yaw is at most 32 over the square
of the length (radius of gyration of a quarter of the length, twice the mass aside)."""
SPEEDS_MPS = (3.0, 8.0)
DIRECTIONS = ((1.0, 0.0), (0.7, 0.7), (0.0, 1.0), (-0.7, 0.7), (-1.0, 0.0), (-0.7, -0.7), (0.0, -1.0), (0.7, -0.7))


def _candidates_wind(situation: Situation) -> tuple[Candidate, ...]:
    ship, windows = situation.ship, situation.windows
    terms, reads_air = absent_terms(situation, air=True), own_air_terms(ship.model)
    found: list[Candidate] = []
    if windows.has_wind:
        if terms:
            found.append(Candidate(cause="wind", free={f"term:{name}": 0.0 for name in terms}))
            found += [Candidate(cause="wind", free={f"term:{name}": 0.0}) for name in terms if len(terms) > 1]
        if reads_air:
            found.append(Candidate(cause="wind", free={f"theta:{name}": 0.0 for name in reads_air}))
            found += [Candidate(cause="wind", free={f"theta:{name}": 0.0}) for name in reads_air if len(reads_air) > 1]
    elif windows.has_heading and terms and not reads_air:
        found += _of_unknown_wind(situation, terms)
    elif windows.has_heading and reads_air:
        if any(key.startswith("wind:") for key in ship.stated):
            found.append(Candidate(cause="wind", free={"wind:north": 0.0, "wind:east": 0.0}))
        found += [
            Candidate(cause="wind", free={"wind:north": speed * n, "wind:east": speed * e}, finite=True)
            for speed in SPEEDS_MPS
            for n, e in DIRECTIONS
        ]
    return tuple(found)


def wind_can_be_told(windows: Windows) -> bool:
    """Whether headings differ enough to tell a wind that is not measured from causes with fewer numbers."""
    mean = math.atan2(float(np.sin(windows.heading).sum()), float(np.cos(windows.heading).sum()))
    turned = np.angle(np.exp(1j * (windows.heading - mean)))
    return bool(np.abs(turned).max() >= LEAST_TURN_RAD)


def _of_unknown_wind(situation: Situation, terms: list[str]) -> list[Candidate]:
    """Air drag in the mean wind that the vessel file states, or in one of unknown direction.

    Drag grows with the square of the wind speed. Data without measured wind therefore determine its direction, and
    the drag coefficients for an assumed speed.
    """
    free = {f"term:{name}": 0.0 for name in terms}
    if situation.has("wind:north") or situation.has("wind:east"):
        return [Candidate(cause="wind", free=free)]
    if situation.has("wind:toward") or not wind_can_be_told(situation.windows):
        return []
    turns = 2 * math.pi * np.arange(SECTORS) / SECTORS
    around = np.linspace(-1, 1, FINER) * math.pi / SECTORS
    return [
        Candidate(
            cause="wind",
            free=free,
            fixed={"wind:speed": ASSUMED_MPS, "wind:toward": float(turn)},
            grid=("wind:toward", tuple((turn + around).tolist())),
            bounds=_bounds(set(free), situation.ship.length_m),
            imitates=True,
        )
        for turn in turns
    ]


def _bounds(free: Set[str], length_m: float) -> tuple[Mapping[str, float], ...]:
    """What is possible of drag: air pushes where it blows, no more ahead than aside, and somewhere along the hull."""
    bounds: tuple[Mapping[str, float], ...] = (
        {AHEAD: 1.0},
        {ASIDE: 1.0},
        {AHEAD: -1.0, ASIDE: MOST_AHEAD},
        *({TURNING: sign * length_m, ASIDE: MOST_TURNING} for sign in (1.0, -1.0)),
    )
    return tuple(bound for bound in bounds if set(bound) <= free)


def _explain_wind(values: Values, _ship: ExtendedModel) -> str:
    if "wind:toward" in values:
        toward, std = (math.degrees(number) for number in values["wind:toward"])
        drag = {key: pair for key, pair in values.items() if key != "wind:toward"}
        return (
            f"The error depends on the heading like air drag in a steady wind towards {rounded(toward % 360, std)} "
            f"degrees. No wind is measured, so its speed is assumed to be {ASSUMED_MPS:g} m/s. The drag coefficients "
            f"({listed(drag)}) hold for this speed."
        )
    if "wind:north" in values:
        return f"Air drag in a mean wind blowing to {listed(values, ' m/s')} explains the error."
    return f"The error grows with the relative wind. The model lacks air drag of the hull ({listed(values)})."


WIND = Cause(
    name="wind",
    title="Wind",
    missing="wind",
    summary="wind: drag of the air on hull and superstructure, with measured wind or with an unknown mean one",
    candidates=_candidates_wind,
    explain=_explain_wind,
    unseen="the model has no equation that air acts in",
)
