"""Reading a plan back from plan.json with the track.csv and commands.csv beside it.

The three files must agree, and the plan must have passed its checks.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from expdesign.conventions import POSE_COLUMNS, VELOCITY_COLUMNS
from expdesign.errors import FileError, NoPlan
from expdesign.export.files.text import RESULT, Entry, read_json
from expdesign.export.routes.route import Fence
from expdesign.input_files import read_text
from expdesign.plan.values import Leg, Plan
from expdesign.sea_area import LocalFrame
from expdesign.signals import Commands, Trajectory
from expdesign.simulation.environment import Environment
from expdesign.values import Array
from expdesign.vessel import Variation, Vessel, column_name


class _Vessel(Entry):
    name: str
    length_m: float = Field(gt=0)
    beam_m: float = Field(gt=0)


class _Origin(Entry):
    lat_deg: float = Field(ge=-90, le=90)
    lon_deg: float = Field(ge=-180, le=180)


class _Frame(Entry):
    projection: str
    origin: _Origin


class _Medium(Entry):
    north_mps: float
    east_mps: float
    std_mps: float = Field(ge=0)
    variation_std_mps: float = Field(default=0.0, ge=0)
    correlation_s: float = Field(default=0.0, ge=0)


class _Environment(Entry):
    current_to: _Medium
    wind_to: _Medium
    sea_state: int | None = Field(default=None, ge=0, le=9)


class _State(Entry):
    time_s: float
    north_m: float
    east_m: float
    heading_rad: float
    u_mps: float
    v_mps: float
    r_radps: float

    @property
    def motion(self) -> Array:
        return np.array([getattr(self, name) for name in (*POSE_COLUMNS, *VELOCITY_COLUMNS)])


class _Leg(Entry):
    index: int
    kind: Literal["primitive", "reposition"]
    name: str
    path: str = ""
    start: _State
    end: _State


class _Fence(Entry):
    inside: tuple[tuple[float, float], ...] = Field(min_length=3)
    outside: tuple[tuple[tuple[float, float], ...], ...] = ()


class _DrawnTrials(Entry):
    aborted_share: float = Field(default=0.0, ge=0, le=1)
    aborted_most: float = Field(default=1.0, ge=0, le=1)


class PlanFile(Entry):
    """The entries of plan.json."""

    scenario: str
    vessel: _Vessel
    sample_time_s: float = Field(gt=0)
    inputs: list[str] = Field(min_length=1)
    frame: _Frame
    environment: _Environment
    legs: list[_Leg] = Field(min_length=1)
    clearance_required_m: float = Field(ge=0)
    fence: _Fence | None = None
    verified: bool
    draft: bool = False
    drawn_trials: _DrawnTrials | None = None

    @property
    def passed(self) -> bool:
        """Whether the plan passed its checks, though perhaps more drawn trials were aborted than may be."""
        drawn = self.drawn_trials
        return self.verified or (drawn is not None and drawn.aborted_share > drawn.aborted_most)


def environment_of(file: _Environment) -> Environment:
    """Current and wind as the package uses them."""
    current, wind = file.current_to, file.wind_to
    return Environment(
        current_to=np.array([current.north_mps, current.east_mps]),
        wind_to=np.array([wind.north_mps, wind.east_mps]),
        current_std_mps=current.std_mps,
        wind_std_mps=wind.std_mps,
        current_variation=Variation(std_mps=current.variation_std_mps, correlation_s=current.correlation_s),
        wind_variation=Variation(std_mps=wind.variation_std_mps, correlation_s=wind.correlation_s),
        sea_state=file.sea_state,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedTrack:
    """Commands and the motion they give, from start to goal; verified."""

    # scenario, vessel: names
    scenario: str
    vessel: str
    # length_m, beam_m: of the vessel [m]
    length_m: float
    beam_m: float
    frame: LocalFrame  # relates north/east metres to latitude and longitude
    environment: Environment  # the forecast it was planned for
    commands: Commands  # (k, m) actuator commands
    trajectory: Trajectory  # k + 1 samples
    legs: tuple[Leg, ...]  # in time order, without gaps
    clearance_m: float  # least distance from the hull to forbidden water that is required [m]
    fence: Fence | None = None  # allowed water around the track, or None when it is not known

    @property
    def sample_leg(self) -> np.ndarray:
        """(k + 1,) index of the leg each sample belongs to; a leg owns its first sample, the last one owns its last."""
        starts = [leg.first for leg in self.legs]
        return np.searchsorted(starts, np.arange(len(self.trajectory)), side="right") - 1


def planned_track(
    plan: Plan, *, scenario: str, vessel: Vessel, environment: Environment, clearance_m: float
) -> PlannedTrack:
    """The part of a plan that its files hold.

    Raises:
        NoPlan: the plan is not verified.
    """
    require_verified(plan)
    return PlannedTrack(
        scenario=scenario,
        vessel=vessel.name,
        length_m=vessel.length_m,
        beam_m=vessel.beam_m,
        frame=plan.area.frame,
        environment=environment,
        commands=plan.commands,
        trajectory=plan.trajectory,
        legs=plan.legs,
        clearance_m=clearance_m,
    )


def require_verified(plan: Plan) -> None:
    """A draft, or a plan that failed a check, never becomes a file that somebody could sail; one often aborted does.

    Raises:
        NoPlan: naming the failed checks.
    """
    if plan.draft:
        raise NoPlan(f"the plan is {plan.verdict}; expected one made without --draft")
    if not plan.verification.passed:
        raise NoPlan(f"the plan is not verified and is not written: {'; '.join(plan.verification.problems)}")


TRACK_COLUMNS = ("time_s", *POSE_COLUMNS, *VELOCITY_COLUMNS, "leg", "lat_deg", "lon_deg")
EXPECTED = "a plan.json as expdesign plan and expdesign run write it"
STATE_TOLERANCE = 1e-5
"""Largest difference between plan.json, which has every digit, and track.csv, which has micrometres [m, rad, m/s,
rad/s]."""
DEGREE_TOLERANCE = 1e-7
TIME_TOLERANCE_S = 1e-6


def read_plan(path: Path) -> PlannedTrack:
    """The plan of plan.json, with track.csv and commands.csv from the same folder.

    Raises:
        FileError: a file is missing or garbled, the files contradict each other, or the plan failed its checks.
    """
    file = read_json(path, PlanFile, EXPECTED)
    if file.draft:
        raise FileError(path, "draft", "is true: nobody may sail a draft, plan again without --draft before using it")
    if not file.passed:
        raise FileError(path, "verified", "is false: the plan failed its checks, plan again before using it")
    frame = LocalFrame(file.frame.origin.lat_deg, file.frame.origin.lon_deg)
    if file.frame.projection != frame.definition:
        raise FileError(path, "frame.projection", f"is {file.frame.projection!r}, expected {frame.definition!r}")
    legs = _legs(path, file)
    track = _read_table(path.with_name("track.csv"), TRACK_COLUMNS)
    _check_track(path, file, frame, legs, track)
    command_path = path.with_name("commands.csv")
    commands = _read_table(command_path, ("time_s", *(column_name(name) for name in file.inputs), "leg"))
    _check_rows(command_path, commands, file.sample_time_s, legs, expected=legs[-1].last, leg_column=-1)
    return PlannedTrack(
        scenario=file.scenario,
        vessel=file.vessel.name,
        length_m=file.vessel.length_m,
        beam_m=file.vessel.beam_m,
        frame=frame,
        environment=environment_of(file.environment),
        commands=Commands(sample_time_s=file.sample_time_s, names=tuple(file.inputs), values=commands[:, 1:-1]),
        trajectory=Trajectory(sample_time_s=file.sample_time_s, pose=track[:, 1:4], velocity=track[:, 4:7]),
        legs=legs,
        clearance_m=file.clearance_required_m,
        fence=None if file.fence is None else Fence(inside=file.fence.inside, outside=file.fence.outside),
    )


def _legs(path: Path, file: PlanFile) -> tuple[Leg, ...]:
    legs: list[Leg] = []
    for number, entry in enumerate(file.legs):
        key = f"legs.{number}"
        first, last = (_sample(path, file, f"{key}.{end}", getattr(entry, end).time_s) for end in ("start", "end"))
        expected = legs[-1].last if legs else 0
        if entry.index != number:
            raise FileError(path, f"{key}.index", f"is {entry.index}, expected {number}")
        if first != expected:
            begins = expected * file.sample_time_s
            raise FileError(path, f"{key}.start.time_s", f"is {entry.start.time_s:g}, expected {begins:g}")
        if last <= first:
            raise FileError(path, f"{key}.end.time_s", f"is {entry.end.time_s:g}, expected a time after the start")
        legs.append(Leg(kind=entry.kind, name=entry.name, first=first, last=last, path=entry.path))
    return tuple(legs)


def _sample(path: Path, file: PlanFile, key: str, time_s: float) -> int:
    sample = round(time_s / file.sample_time_s)
    if abs(sample * file.sample_time_s - time_s) > TIME_TOLERANCE_S:
        raise FileError(path, f"{key}.time_s", f"is {time_s!r}, expected a multiple of {file.sample_time_s:g} s")
    return sample


def _read_table(path: Path, columns: tuple[str, ...]) -> Array:
    rows = list(csv.reader(read_text(path, RESULT).splitlines()))
    if not rows or tuple(rows[0]) != columns:
        found = ",".join(rows[0]) if rows else "nothing"
        raise FileError(path, "row 1", f"has the columns {found}, expected {','.join(columns)}")
    table = np.empty((len(rows) - 1, len(columns)))
    for number, row in enumerate(rows[1:]):
        if len(row) != len(columns):
            raise FileError(path, f"row {number + 2}", f"has {len(row)} cells, expected {len(columns)}")
        for column, cell in enumerate(row):
            table[number, column] = _number(path, f"row {number + 2}, {columns[column]}", cell)
    return table


def _number(path: Path, key: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FileError(path, key, f"is {cell!r}, expected a number")
    return value


def _check_rows(
    path: Path, table: Array, sample_time_s: float, legs: tuple[Leg, ...], *, expected: int, leg_column: int
) -> None:
    """The rows are as many as the plan has samples, at its times, and belong to its legs."""
    if len(table) != expected:
        raise FileError(path, "", f"has {len(table)} rows, but plan.json beside it has {expected} samples")
    times = np.arange(expected) * sample_time_s
    leg = np.searchsorted([leg.first for leg in legs], np.arange(expected), side="right") - 1
    for column, name, right in ((0, "time_s", times), (leg_column, "leg", leg)):
        wrong = np.flatnonzero(np.abs(table[:, column] - right) > TIME_TOLERANCE_S)
        if len(wrong):
            row = wrong[0]
            raise FileError(path, f"row {row + 2}, {name}", f"is {table[row, column]:g}, expected {right[row]:g}")


def _check_track(path: Path, file: PlanFile, frame: LocalFrame, legs: tuple[Leg, ...], track: Array) -> None:
    track_path = path.with_name("track.csv")
    column = TRACK_COLUMNS.index("leg")
    _check_rows(track_path, track, file.sample_time_s, legs, expected=legs[-1].last + 1, leg_column=column)
    for number, (leg, entry) in enumerate(zip(legs, file.legs, strict=True)):
        for sample, end in ((leg.first, "start"), (leg.last, "end")):
            if np.abs(track[sample, 1:7] - getattr(entry, end).motion).max() > STATE_TOLERANCE:
                raise FileError(
                    track_path, f"row {sample + 2}", f"is not the state that plan.json gives as legs.{number}.{end}"
                )
    error = (track[:, 8:] - frame.to_degrees(track[:, 1:3]) + 180.0) % 360.0 - 180.0
    wrong = np.flatnonzero(np.abs(error).max(axis=1) > DEGREE_TOLERANCE)
    if len(wrong):
        raise FileError(
            track_path, f"row {wrong[0] + 2}, lat_deg", "and lon_deg are not where north_m and east_m are in this frame"
        )
