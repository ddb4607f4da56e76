"""Displacement of runs in seconds of the fastest leg: what they can save of the path to the goal at most.

Where wind makes a difference, runs are simulated at headings all round, with a margin for those in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from expdesign.dictionary import Primitive
from expdesign.plan.control import over_ground
from expdesign.plan.runs import run_at_headings
from expdesign.simulation import Environment
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel

TRACK_SIDES = 24  # of the polygon that contains a track

WIND_HEADINGS = 72  # at which runs are simulated where wind makes a difference
WIND_MARGIN = 1.02  # factor for what headings in between may give more
TRACK_SAMPLES = 13  # samples of a run at which its hull needs room
SIDES_MARGIN = 1.01  # no corner of such a polygon is farther away than its farthest side by more


@dataclass(frozen=True, kw_only=True)
class Displacement:
    """What a run can contribute to the path at its best heading."""

    chord_s: float  # time that a leg needs from its start to its end [s]
    path_s: float  # the same along its path [s]
    deviation_m: float  # no point of the chord is farther than this from the path [m]


@sealed(current_to="2")
class Headway:
    """The fastest leg."""

    speed_mps: float  # through water
    current_to: Array  # (2,) of the water [m/s], slower than that

    @property
    def current_mps(self) -> float:
        """Speed of the water."""
        return float(np.hypot(*self.current_to))

    def seconds(self, ground: Array) -> Array:
        """(...,) least time of straight legs (..., 2) over ground [s]."""
        along = ground @ self.current_to
        spare = self.speed_mps**2 - self.current_mps**2
        return np.asarray((np.sqrt(along**2 + spare * (ground**2).sum(axis=-1)) - along) / spare)

    def most_s(self, water_m: Array, lasting_s: Array | float) -> Array:
        """(...,) least time of the displacement by a length through water in a time, at its worst heading [s].

        A leg of time t makes good d when p.d <= t for all slownesses p with V |p| + c.p = 1. Of l through water and
        c T that is at most |p| l + (1 - V |p|) T, so the ends 1 / (V + c) and 1 / (V - c) of |p| decide.
        """
        behind = self.speed_mps * lasting_s - water_m
        slowness = 1.0 / (self.speed_mps + np.where(behind >= 0, 1.0, -1.0) * self.current_mps)
        return np.asarray(lasting_s - slowness * behind)


def displacement_of(vessel: Vessel, primitive: Primitive, environment: Environment, headway: Headway) -> Displacement:
    """Largest displacement of a run, and how far its path deviates from its chord."""
    track = primitive.trajectory.pose[:, :2]
    if differs_by_heading(vessel, environment):
        tracks = np.moveaxis(_in_weather(vessel, primitive, environment)[..., :2], 1, 0)
        return _displacement_in_weather(list(tracks), headway)
    steps = np.hypot(*np.diff(track, axis=0).T)
    chord = float(np.hypot(*(track[-1] - track[0])))
    drift_m, lasting_s = headway.current_mps * primitive.duration_s, primitive.duration_s
    return Displacement(
        chord_s=float(headway.most_s(np.array(chord), lasting_s)),
        path_s=float(headway.most_s(steps, lasting_s / len(steps)).sum()),
        deviation_m=min(_deviation_m(track) + drift_m, _deviation_adrift_m(track, drift_m))
        if drift_m
        else _deviation_m(track),
    )


def exit_motion(vessel: Vessel, primitive: Primitive, environment: Environment) -> tuple[float, float, float]:
    """Least and largest speed through water [m/s] and largest yaw rate [rad/s] at the end of a run."""
    if not differs_by_heading(vessel, environment):
        speed = float(np.hypot(*primitive.exit_velocity[:2]))
        return speed, speed, abs(float(primitive.exit_velocity[2]))
    last = _in_weather(vessel, primitive, environment)[-1]
    speeds = np.hypot(*(over_ground(last) - environment.current_to).T)
    return (
        float(speeds.min()) / WIND_MARGIN,
        float(speeds.max()) * WIND_MARGIN,
        float(np.abs(last[:, 5]).max()) * WIND_MARGIN,
    )


def _displacement_in_weather(tracks: list[Array], headway: Headway) -> Displacement:
    """The displacement from tracks (k, 2) over ground at headings all round."""
    chords = [float(headway.seconds(track[-1] - track[0])) for track in tracks]
    paths = [float(headway.seconds(np.diff(track, axis=0)).sum()) for track in tracks]
    return Displacement(
        chord_s=WIND_MARGIN * max(chords),
        path_s=WIND_MARGIN * max(paths),
        deviation_m=WIND_MARGIN * max(_deviation_m(track) for track in tracks),
    )


def _deviation_adrift_m(track: Array, drift_m: float) -> float:
    """Bound on the distance of a chord's points from a track (k, 2) through water that drifts in any direction.

    At equal shares of the chord and of the time, both have drifted equally; otherwise by the drift in the time between.
    """
    share, when = np.linspace(0.0, 1.0, 201), np.linspace(0.0, 1.0, len(track))
    points = track[0] + share[:, None] * (track[-1] - track[0])
    apart = np.hypot(*np.moveaxis(points[:, None] - track, -1, 0)) + drift_m * np.abs(share[:, None] - when)
    between = (float(np.hypot(*(track[-1] - track[0]))) + drift_m) / 400
    return float(apart.min(axis=1).max()) + between


def differs_by_heading(vessel: Vessel, environment: Environment) -> bool:
    """Whether wind relative to the water acts on the model: the dictionary's runs are simulated without."""
    used = zip(vessel.model.expressions, vessel.model.parameters, strict=True)
    in_air = any(value and {"u_q", "v_q"} & set(expression.signals) for expression, value in used)
    return in_air and bool((environment.wind_to - environment.current_to).any())


def _in_weather(vessel: Vessel, primitive: Primitive, environment: Environment) -> Array:
    """(k, headings, 6) states over ground of the run at headings all round, in the forecast's mean current and wind."""
    return run_at_headings(
        vessel,
        primitive,
        np.arange(WIND_HEADINGS) * 2 * np.pi / WIND_HEADINGS,
        entering=environment.current_to,
        current_to=np.tile(environment.current_to, (WIND_HEADINGS, 1)),
        wind_to=np.tile(environment.wind_to, (WIND_HEADINGS, 1)),
        parameters=np.tile(vessel.model.parameters, (WIND_HEADINGS, 1)),
    )


def _deviation_m(track: Array) -> float:
    """Largest distance of the chord's points from a track (k, 2)."""
    points = track[0] + np.linspace(0, 1, 201)[:, None] * (track[-1] - track[0])
    apart = shapely.distance(shapely.points(points), shapely.linestrings(track))
    return float(apart.max()) + float(np.hypot(*(track[-1] - track[0]))) / 400


SIDES = np.stack([np.cos(angle := np.arange(TRACK_SIDES) * 2 * np.pi / TRACK_SIDES), np.sin(angle)], axis=1)
"""Normals of the sides of a polygon that contains a track."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """A run over ground from a reference: points that turn with the heading, and their drift, which does not."""

    # (3 TRACK_SAMPLES, 2) ahead and to starboard: amidships, both ends included, then points ahead and astern of
    # it that are also half the beam from the hull's sides
    water: Array
    drift: Array  # (3 TRACK_SAMPLES, 2) north and east
    hull_m: Array  # (24,) distances from the reference of the sides of a polygon that contains the track through water

    @property
    def reach_m(self) -> float:
        """How far from the reference anything is that turns with the heading."""
        return max(float(np.hypot(*self.water.T).max()), SIDES_MARGIN * float(self.hull_m.max()))

    @property
    def ends_m(self) -> float:
        """The same of the track's ends."""
        return float(np.hypot(*self.water[[0, TRACK_SAMPLES - 1]].T).max())

    @property
    def drift_m(self) -> float:
        """Largest drift."""
        return float(np.hypot(*self.drift.T).max())

    def at(self, cells: Array, k: int) -> Array:
        """(n, 2) where point k is at poses (n, 3)."""
        c, s = np.cos(cells[:, 2]), np.sin(cells[:, 2])
        (x, y), (north, east) = self.water[k], self.drift[k]
        return np.stack([cells[:, 0] + c * x - s * y + north, cells[:, 1] + s * x + c * y + east], axis=1)

    def ends(self, cells: Array) -> tuple[Array, Array]:
        """(n, 2) where runs begin, and where they end."""
        return self.at(cells, 0), self.at(cells, TRACK_SAMPLES - 1)


def track_of(run: Primitive, vessel: Vessel, current_to: Array) -> Track:
    """The track of a run that is the same through water at every place."""
    pose, time_s = run.trajectory.pose, run.trajectory.time_s
    kept = np.rint(np.linspace(0, len(pose) - 1, TRACK_SAMPLES)).astype(int)
    middle = (pose[:, :2].min(axis=0) + pose[:, :2].max(axis=0)) / 2
    drift = (time_s[kept] - (time_s[0] + time_s[-1]) / 2)[:, None] * current_to
    along = np.stack([np.cos(pose[kept, 2]), np.sin(pose[kept, 2])], axis=1)
    ahead, places = max(0.0, vessel.length_m - vessel.beam_m) / 2 * along, pose[kept, :2] - middle
    return Track(
        water=np.concatenate([places, places + ahead, places - ahead]),
        drift=np.tile(drift, (3, 1)),
        hull_m=(SIDES @ (pose[:, :2] - middle).T).max(axis=1),
    )
