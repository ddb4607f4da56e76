"""The state of a trial that goes on: position, time left, and the ship as the data so far show her."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.conventions import OUTPUTS, to_n_frame
from expdesign.dictionary import build_primitive
from expdesign.dictionary.spec import PrimitiveSpec
from expdesign.errors import Diverged, FileError, InputError, NoAnswer, UnknownName, Unreachable
from expdesign.export.words import place
from expdesign.information import estimated_parameters
from expdesign.plan.values import UnderWay
from expdesign.progress import Progress, silent
from expdesign.records import Fix, last_fix
from expdesign.reduction import reduced
from expdesign.scenario import Scenario
from expdesign.scenario.scenario_file import berth_problem, build_berth
from expdesign.shortest_day import AccuracySettings
from expdesign.signals import Batch, Record
from expdesign.simulation import Environment, acting_response, delivered_at_samples
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel
from expdesign.workflows.steps.known import updated
from expdesign.workflows.steps.measured import equipped, measured

MOTION_S, MOTION_ROWS = 5.0, 3
"""Time before the last row whose velocities tell how the ship moves there, and the fewest that must be known."""
PARTICULARS = ("length_m", "beam_m", "draught_m", "sample_time_s")


@sealed(pose="3")
class PresentState:
    """Where a trial stands."""

    first: Scenario  # the scenario of the whole trial
    data: tuple[Path, ...]  # files so far
    record: Record  # what they hold
    pose: Array  # (3,) of the ship in the area's frame
    sailed_s: float  # time in the data
    left_s: float  # informative time left; nan where it is as long as design.accuracy takes
    left_stated: bool  # whether --remaining gives it
    ship: Vessel  # what the rest is planned with
    origin: str  # where its model comes from
    notes: tuple[str, ...]  # what a reader must hear
    under_way: UnderWay | None = None  # how it moves; None where it has stopped through the water


def present_state(
    first: Scenario,
    data: Sequence[Path],
    *,
    vessel: Path | None = None,
    remaining_s: float | None = None,
    stopped: bool = False,
    progress: Progress = silent,
) -> PresentState:
    """Where the trial of a scenario stands; other arguments as of `replan`.

    Raises:
        InputError: something in the files is wrong, the ship is not in safe water, or no time is left.
    """
    ship, told = (first.vessel, first.told) if vessel is None else equipped(vessel, data)
    if vessel is not None:
        ship = _same_ship(ship, first, vessel)
    record = measured(data, ship, told=told)
    pose = present_pose(last_fix(data[-1]), ship, first)
    sailed_s = float(sum(len(batch) * batch.sample_time_s for batch in record.batches))
    left_s = _left(first, sailed_s, remaining_s)
    origin = f"that of {vessel}"
    notes = record.notes
    seen = reduced(record, ship) if vessel is None or not stopped else record
    under_way = None if stopped else present_motion(seen, record, ship, data[-1])
    if vessel is None:
        fixed, prior_counts = first.design.fixed_parameters, first.design.prior == "parameter_std"
        ship, origin, notes = updated(ship, record, seen, fixed=fixed, prior_counts=prior_counts, progress=progress)
        notes = (*seen.notes, *notes)
    return PresentState(
        first=first,
        data=tuple(data),
        record=record,
        pose=pose,
        sailed_s=sailed_s,
        left_s=left_s,
        left_stated=remaining_s is not None,
        ship=ship,
        origin=origin,
        notes=notes,
        under_way=under_way,
    )


def _same_ship(ship: Vessel, first: Scenario, path: Path) -> Vessel:
    """The vessel, which must be the scenario's but for its model, sensors and weather."""
    for name in PARTICULARS:
        found, wanted = getattr(ship, name), getattr(first.vessel, name)
        if found != wanted:
            raise FileError(path, f"vessel.{name}", f"is {found:g}, expected {wanted:g} as in {first.path}")
    if ship.model.inputs != first.vessel.model.inputs:
        found_inputs, wanted_inputs = ", ".join(ship.model.inputs), ", ".join(first.vessel.model.inputs)
        raise FileError(path, "actuators", f"take {found_inputs}, expected {wanted_inputs} as in {first.path}")
    return ship


def present_pose(fix: Fix, ship: Vessel, first: Scenario) -> Array:
    """(3,) the ship's pose in the area's frame, from a fix by its sensors where they are mounted.

    Raises:
        FileError: the ship has not its clearance there.
    """
    area, sensors = first.area, ship.sensors
    heading_rad = fix.heading_rad - sensors.heading_bias_rad
    antenna = build_berth(np.asarray(fix.position), heading_rad, area, degrees=fix.degrees)
    mounted = np.array(sensors.place("position"))
    pose = np.array([*to_n_frame(-mounted, antenna.pose), heading_rad])
    berth = replace(antenna, pose=pose)
    problem = berth_problem(berth, ship, area, first.plan, end=first.goal, way="a way to the goal")
    if problem:
        lat, lon = area.frame.to_degrees(pose[:2])
        where = f"{lat:.6f}, {lon:.6f}" if np.isfinite([lat, lon]).all() else place(pose)
        raise FileError(fix.path, f"row {fix.row}", f"the ship's last position ({where}) {problem}")
    return pose


def present_motion(seen: Record, record: Record, ship: Vessel, path: Path) -> UnderWay:
    """How the ship moves at the last row: the end of a straight line through its velocities in the last seconds.

    Commands that dead times still hold back are taken to be lost.

    Args:
        seen: the data, velocities reduced to the reference point.
        record: the same, with commands as inputs.
        ship: whose actuators deliver them.

    Raises:
        FileError: the last seconds hold no velocity.
    """
    batch = seen.batches[-1]
    rows = max(MOTION_ROWS, round(MOTION_S / batch.sample_time_s) + 1)
    velocity = np.array([_at_end(column[-rows:]) for column in batch.velocity.T])
    if np.isnan(velocity).any():
        name = OUTPUTS[int(np.argmax(np.isnan(velocity)))]
        row = f"row {record.batches[-1].first_row + len(record.batches[-1]) - 1}"
        raise FileError(
            path,
            row,
            f"the last {MOTION_S:g} s hold no velocity {name}, expected it or the pose in {MOTION_ROWS} rows at least, "
            "or --stopped for a ship that stops before the rest begins",
        )
    return UnderWay(velocity=velocity, inputs=_standing(record.batches[-1], ship))


def _at_end(values: Array) -> float:
    """The end of a straight line through values (k,); nan where too few are known."""
    rows = np.flatnonzero(np.isfinite(values))
    if len(rows) < MOTION_ROWS:
        return np.nan
    return float(np.polyval(np.polyfit(rows - (len(values) - 1), values[rows], 1), 0.0))


def _standing(batch: Batch, ship: Vessel) -> Array:
    """(m,) commands that would give what the actuators deliver at the last row; zeros where the data give forces."""
    names = ship.model.inputs
    if not set(names) <= set(batch.input_names):
        return np.zeros(len(names))
    given = batch.inputs[:, [batch.input_names.index(name) for name in names]]
    responses = [acting_response(batch, *row) for row in zip(names, ship.responses, strict=True)]
    before, now = delivered_at_samples(responses, given, sample_time_s=batch.sample_time_s)[-2:]
    settled = before - np.array([response.offset for response in responses])
    prompt = np.array([response.follows for response in responses])
    limits = np.array([(limit.low, limit.high) for limit in ship.limits]).T
    return np.asarray(np.clip(np.where(prompt, now, settled), *limits))


def _left(first: Scenario, sailed_s: float, stated_s: float | None) -> float:
    """Informative time left; nan where it is as long as design.accuracy takes."""
    if stated_s is not None:
        if not 0 < stated_s < np.inf:
            raise InputError(f"--remaining is {stated_s:g}, expected more than 0 seconds")
        return stated_s
    if first.design.accuracy is not None:
        return float("nan")
    left_s = first.design.total_s - sailed_s
    if not left_s > 0:
        raise InputError(
            f"the data last {sailed_s:g} s and design.total_s of {first.path} is {first.design.total_s:g}: no time is "
            "left; expected --remaining S, the informative time left, if the data include repositioning"
        )
    return left_s


def weather_for_rest(scenario: Environment, vessel: Environment) -> tuple[Environment, str]:
    """The scenario's current and wind; where it has no mean one and the vessel file has, the vessel file's.

    Uncertainty is the larger of both, and so is variation. Returns the forecast and where it comes from.
    """
    chosen, words = scenario, []
    for name in ("current", "wind"):
        to, std, variation = f"{name}_to", f"{name}_std_mps", f"{name}_variation"
        if getattr(scenario, to).any() or not getattr(vessel, to).any():
            words.append(f"{name} from the scenario")
            continue
        rows = (getattr(vessel, variation), getattr(scenario, variation))
        changes = {
            to: getattr(vessel, to),
            std: max(getattr(vessel, std), getattr(scenario, std)),
            variation: max(rows, key=lambda item: item.std_mps),
        }
        chosen = replace(chosen, **changes)
        words.append(f"{name} from the vessel file, as the scenario has none")
    return chosen, ", ".join(words)


def rest_of(state: PresentState, *, interest: Sequence[str] = ()) -> tuple[Scenario, tuple[str, ...]]:
    """The scenario of the rest, without manoeuvres that the ship as known now cannot do, and notes.

    Args:
        state: where the trial stands.
        interest: parameters that the rest is to be best for, by criterion D_s; the scenario's criterion when empty.

    Raises:
        UnknownName: no such parameter to be estimated.
        NoAnswer: it can do none.
        InputError: it cannot do one that is required.
    """
    first, settings, limits = state.first, state.first.design, state.first.design.limits
    weather, _ = weather_for_rest(first.environment, state.ship.environment)
    if interest:
        known = estimated_parameters(state.ship.model, settings.fixed_parameters)
        for name in interest:
            if name not in known:
                raise UnknownName("parameter after --interest", name, known=known)
        settings = replace(settings, criterion="D_s", interest=tuple(dict.fromkeys(interest)))
    kept, notes = _possible(state.ship, first.dictionary, needed={*limits.required, *limits.least_s})
    names = {spec.name for spec in kept}
    if limits.least_s or limits.most_s or limits.required or limits.budgets:
        notes = (*notes, "Limits of the scenario's [design] on times, runs and budgets apply to the rest of the trial.")
    accuracy = settings.accuracy
    if accuracy is not None and not state.left_stated:
        accuracy = _left_of_day(accuracy, state.sailed_s)
    elif accuracy is not None:
        instead = "what design.accuracy lacks" if accuracy.day_s is None else "in what is left of design.day_s"
        notes = (*notes, f"The rest tells most in the time left, as --remaining asks, not {instead}.")
        accuracy = None
    design = replace(
        settings,
        total_s=first.design.total_s if accuracy else state.left_s,
        accuracy=accuracy,
        prior_data=(*settings.prior_data, *state.data),
        limits=replace(
            limits,
            most_s={name: value for name, value in limits.most_s.items() if name in names},
            excluded=tuple(name for name in limits.excluded if name in names),
        ),
    )
    case = replace(
        first,
        vessel=state.ship,
        dictionary=kept,
        design=design,
        start=state.pose,
        under_way=state.under_way,
        environment=weather,
    )
    return case, notes


def _left_of_day(asked: AccuracySettings, sailed_s: float) -> AccuracySettings:
    """What is asked of the day, its lengths less the time sailed."""
    lengths = {"design.day_s": asked.day_s, "design.accuracy.most_s": asked.most_s}
    for key, length_s in lengths.items():
        if length_s is not None and length_s <= sailed_s:
            raise InputError(
                f"the data last {sailed_s:g} s and {key} is {length_s:g}: no time is left; expected a longer day, or "
                "--remaining S, the informative time left"
            )
    day_s, most_s = (None if length_s is None else length_s - sailed_s for length_s in lengths.values())
    return replace(asked, day_s=day_s, most_s=most_s)


def _possible(
    ship: Vessel, dictionary: Sequence[PrimitiveSpec], *, needed: set[str]
) -> tuple[tuple[PrimitiveSpec, ...], tuple[str, ...]]:
    kept, notes, why = [], [], ""
    for spec in dictionary:
        try:
            build_primitive(ship, spec)
            kept.append(spec)
        except (InputError, Diverged, Unreachable) as error:
            if spec.name in needed:
                raise
            why = str(error)
            notes.append(f"Left out of the dictionary with the model as known now: {why}.")
    if not kept:
        raise NoAnswer(
            f"the ship cannot do any manoeuvre of the dictionary with the model as known now; the last: {why}"
        )
    return tuple(kept), tuple(notes)
