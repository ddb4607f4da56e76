"""The plan as plan.json, track.csv and commands.csv, how accurately it is expected to tell parameters, and replan.json.

Numbers in plan.json and commands.csv are written so that reading them back gives the same float. Velocities are over
ground. replan.json says what is known when the rest of a trial is planned, and what the rest adds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from expdesign.conventions import POSE_COLUMNS, VELOCITY_COLUMNS
from expdesign.durations import DurationProblem
from expdesign.errors import NoAnswer
from expdesign.export.files.text import csv_text, entry, finite, named, sample_seconds, strict_json
from expdesign.export.routes import build_fence, require_verified
from expdesign.information.expected import TrialPart, expected_deviations
from expdesign.plan.values import LatticeProof, Leg, Plan, RiskEstimate, UnderWay
from expdesign.plan.verify import part_of_track
from expdesign.shortest_day import AccuracySettings
from expdesign.simulation.environment import Environment
from expdesign.values import Array, sealed
from expdesign.vessel import Variation, Vessel, column_name


@sealed(nominal="p", before="p", runs="p", track="p", asked="p")
class PlannedAccuracy:
    """Standard deviations (p,) in the order and the units of the parameters to be estimated."""

    parameters: tuple[str, ...]
    nominal: Array  # their values in the vessel file
    before: Array  # prior, zero where none was stated
    runs: Array  # of estimates from the informative runs alone; nan where they cannot be estimated
    track: Array  # of estimates from the whole track
    asked: Array  # largest that the scenario asks for, nan where it asks for none


def planned_accuracy(
    plan: Plan,
    problem: DurationProblem,
    *,
    vessel: Vessel,
    environment: Environment,
    asked: AccuracySettings | None = None,
) -> PlannedAccuracy:
    """Standard deviations expected of instrumental variables, to first order in the vessel file's sensor noise.

    Parameters that nothing tells apart do not keep others from theirs.
    """
    model, sailed, names = vessel.model, plan.sailed, problem.parameters

    def deviations(parts: Sequence[TrialPart]) -> Array:
        try:
            return expected_deviations(
                vessel,
                parts,
                names,
                environment=environment,
                mean_subtraction=problem.mean_subtraction,
                unknown_current=environment.current_std_mps > 0,
            )
        except NoAnswer:
            return np.full(len(names), np.nan)

    place = [model.names.index(name) for name in names]
    nominal = model.parameters[place]
    return PlannedAccuracy(
        parameters=names,
        nominal=nominal,
        before=model.parameter_std[place],
        runs=deviations([part_of_track(sailed, leg.first, leg.last) for leg in sailed.legs if leg.kind == "primitive"]),
        track=deviations([part_of_track(sailed)]),
        asked=np.array([_asked(asked, *pair) for pair in zip(names, nominal.tolist(), strict=True)]),
    )


def _asked(settings: AccuracySettings | None, name: str, nominal: float) -> float:
    """The least of the standard deviations that settings allow a parameter."""
    if settings is None:
        return np.nan
    relative = settings.relative_std.get(name, np.inf) * abs(nominal)
    least = min(settings.std.get(name, np.inf), relative)
    return least if np.isfinite(least) else np.nan


def accuracy_entries(found: PlannedAccuracy) -> dict[str, dict[str, Any]]:
    """The entry `parameters` of plan.json; null where a value is not known."""
    rows = zip(found.parameters, found.nominal, found.before, found.runs, found.track, found.asked, strict=True)
    return {
        name: {
            "nominal": float(nominal),
            "std_before": float(before) or None,
            "std_after_runs": finite(float(runs)),
            "std_after": finite(float(track)),
            "std_asked": finite(float(asked)),
        }
        for name, nominal, before, runs, track, asked in rows
    }


FRAME_SENTENCE = (
    "north_m and east_m are the northing and easting of the projection, in metres from the origin; "
    "latitude and longitude are WGS84; heading_rad is clockwise from north_m"
)

LATTICE_SENTENCE = (
    "cost_s is the repositioning time of the first placement of all runs by the rule of the lattice; no placement on "
    "this lattice costs less than lower_bound_s, but one off the lattice may; places_refused could not be sailed, and "
    "the remaining runs were placed again"
)

METRE_DECIMALS, MOTION_DECIMALS, DEGREE_DECIMALS = 6, 9, 9
SKETCHED, SKETCH_DECIMALS = 40, 7  # places of a leg of a draft, and decimals of their degrees


def plan_json(
    plan: Plan,
    *,
    scenario: str,
    vessel: Vessel,
    environment: Environment,
    clearance_m: float,
    accuracy: PlannedAccuracy | None = None,
) -> str:
    """The plan, leg by leg, with the results of the independent check, as plan.json; that of a draft says so.

    Args:
        plan: verified.
        environment: the forecast it was planned for.
        clearance_m: the required clearance [m].
        accuracy: that is expected of the trial, where it is known.

    Raises:
        NoPlan: the plan is not verified.
    """
    require_verified(replace(plan, draft=False))
    check, frame = plan.verification, plan.area.frame
    return strict_json(
        {
            **({"draft": True} if plan.draft else {}),
            "scenario": scenario,
            "vessel": entry(vessel, "name", "length_m", "beam_m"),
            "sample_time_s": plan.commands.sample_time_s,
            "inputs": list(plan.commands.names),
            "frame": {
                "projection": frame.definition,
                "origin": {"lat_deg": frame.lat_deg, "lon_deg": frame.lon_deg},
                "meaning": FRAME_SENTENCE,
            },
            "environment": {
                "current_to": _wind_or_current(
                    environment.current_to, environment.current_std_mps, environment.current_variation
                ),
                "wind_to": _wind_or_current(environment.wind_to, environment.wind_std_mps, environment.wind_variation),
                **({} if environment.sea_state is None else {"sea_state": environment.sea_state}),
            },
            **_standing_entry(plan),
            "legs": [_leg_entry(plan, index, leg) for index, leg in enumerate(plan.legs)],
            "informative_s": plan.seconds("primitive"),
            "reposition_s": plan.seconds("reposition"),
            "reposition_bound_s": None if plan.draft else plan.reposition_bound_s,
            **({} if plan.lattice is None else {"lattice": _lattice_entry(plan.lattice)}),
            "clearance_min_m": check.clearance_min_m,
            "clearance_required_m": clearance_m,
            "fence": _fence_entry(plan, vessel, clearance_m),
            "leave_water_probability": plan.leave_water_probability,
            "drawn_trials": _risk_entry(plan.risk),
            **({} if accuracy is None else {"parameters": accuracy_entries(accuracy)}),
            **entry(plan, "design_efficiency_placed", "design_efficiency_realised", "verified", "verdict"),
            **({} if check.heel_max_rad is None else {"heel_max_rad": check.heel_max_rad}),
            "verification": {
                **entry(check, "clearance_time_s", "reproduction_error_m", "limit_excess", "problems"),
                **({} if check.stretch_s is None else {"stretch_s": check.stretch_s}),
            },
        }
    )


def _lattice_entry(proof: LatticeProof) -> dict[str, Any]:
    """The proof of the lattice planner, and its scope."""
    return {
        **entry(proof, "spacing_m", "headings", "cost_s", "lower_bound_s", "gap"),
        "places_refused": proof.refused,
        "meaning": LATTICE_SENTENCE,
    }


def _fence_entry(plan: Plan, vessel: Vessel, clearance_m: float) -> dict[str, Any] | None:
    """Allowed water around the track, simplified to its safe side, as rings of latitude and longitude."""
    fence = build_fence(
        plan.trajectory.pose[:, :2],
        water=plan.area.water,
        beam_m=vessel.beam_m,
        clearance_m=clearance_m,
        frame=plan.area.frame,
    )
    return None if fence is None else {"inside": fence.inside, "outside": fence.outside}


def _risk_entry(risk: RiskEstimate | None) -> dict[str, Any] | None:
    """Results of the Monte Carlo trials: shares of all trials, times in addition to the plan."""
    if risk is None:
        return None
    return {
        "trials": risk.trials,
        "leave_water_share": risk.left,
        "leave_water_standard_error": risk.error,
        "leave_water_upper_95": risk.left_most,
        "aborted_share": risk.aborted,
        "aborted_most": risk.aborted_most,
        "aborted_where": list(risk.reasons),
        "note_on_broken_off": risk.note or None,
        "extra_time_median_s": finite(risk.extra_median_s),
        "extra_time_95_s": finite(risk.extra_most_s),
        "goes_round_at_most": risk.go_arounds,
        "run_begins_within": {
            "heading_rad": risk.heading_rad,
            "velocity_mps": min(leg.speed_mps for leg in risk.legs),  # at every start; each leg tells its own
            "yaw_rate_radps": risk.yaw_rate_radps,
        },
    }


def _sailed_entry(plan: Plan, index: int) -> dict[str, float | None]:
    """Results of the Monte Carlo trials on a leg."""
    if plan.risk is None:
        return {"leave_water_probability": dict(enumerate(plan.leave_water_by_leg)).get(index)}
    leg = plan.risk.legs[index]
    return {
        "leave_water_probability": leg.left,
        "begins_within_m": leg.position_m,
        "begins_within_mps": leg.speed_mps,
        "aborted_share": leg.aborted,
        "goes_round_mean": leg.go_arounds,
        "sailed_median_s": leg.median_s,
        "sailed_95_s": leg.most_s,
    }


def _standing_entry(plan: Plan) -> dict[str, dict[str, float]]:
    """Commands that stand before the plan begins; nothing where all are zero."""
    if plan.standing is None or not plan.standing.any():
        return {}
    return {"standing_commands": named([column_name(name) for name in plan.commands.names], plan.standing)}


def _leg_entry(plan: Plan, index: int, leg: Leg) -> dict[str, Any]:
    return {
        "index": index,
        "kind": leg.kind,
        "name": leg.name,
        "start": _state(plan, leg.first),
        "end": _state(plan, leg.last),
        "duration_s": sample_seconds(leg.last - leg.first, plan.commands.sample_time_s),
        **({"path": leg.path} if leg.path else {}),
        **({"sketch_deg": _sketch(plan, leg)} if plan.draft else {}),
        **_sailed_entry(plan, index),
    }


def _sketch(plan: Plan, leg: Leg) -> list[list[float]]:
    """Latitude and longitude of some places of a leg, enough for a drawing and too few to sail by."""
    places = np.unique(np.linspace(leg.first, leg.last, SKETCHED).round().astype(int))
    degrees = plan.area.frame.to_degrees(plan.trajectory.pose[places, :2])
    return [[round(value, SKETCH_DECIMALS) for value in place] for place in degrees.tolist()]


def _state(plan: Plan, sample: int) -> dict[str, float]:
    return {
        "time_s": sample_seconds(sample, plan.commands.sample_time_s),
        **named(POSE_COLUMNS, plan.trajectory.pose[sample]),
        **named(VELOCITY_COLUMNS, plan.trajectory.velocity[sample]),
    }


def track_csv(plan: Plan) -> str:
    """The planned motion, one row per sample, as track.csv; heading is continuous, not wrapped.

    Raises:
        NoPlan: the plan is not verified.
    """
    require_verified(plan)
    motion = np.hstack([plan.trajectory.pose, plan.trajectory.velocity])
    degrees = plan.area.frame.to_degrees(plan.trajectory.pose[:, :2])
    decimals = (METRE_DECIMALS, METRE_DECIMALS, *4 * (MOTION_DECIMALS,))
    rows = (
        (
            _time(sample, plan.trajectory.sample_time_s),
            *(f"{value:.{places}f}" for value, places in zip(values, decimals, strict=True)),
            str(leg),
            *(f"{value:.{DEGREE_DECIMALS}f}" for value in position),
        )
        for sample, (values, leg, position) in enumerate(
            zip((motion.round(12) + 0.0).tolist(), plan.sample_leg.tolist(), degrees.tolist(), strict=True)
        )
    )
    return csv_text(("time_s", *POSE_COLUMNS, *VELOCITY_COLUMNS, "leg", "lat_deg", "lon_deg"), rows)


def commands_csv(plan: Plan) -> str:
    """The actuator commands, each held to the next row, as commands.csv; no digit is lost.

    Raises:
        NoPlan: the plan is not verified.
    """
    require_verified(plan)
    commands, leg = plan.commands, plan.sample_leg.tolist()
    rows = (
        (_time(sample, commands.sample_time_s), *(repr(value) for value in values), str(leg[sample]))
        for sample, values in enumerate(commands.values.tolist())
    )
    return csv_text(("time_s", *(column_name(name) for name in commands.names), "leg"), rows)


def _time(sample: int, sample_time_s: float) -> str:
    return repr(sample_seconds(sample, sample_time_s))


def _wind_or_current(velocity: Array, std_mps: float, variation: Variation) -> dict[str, float]:
    entry = {"north_mps": float(velocity[0]), "east_mps": float(velocity[1]), "std_mps": std_mps}
    if variation.std_mps:
        entry |= {"variation_std_mps": variation.std_mps, "correlation_s": variation.correlation_s}
    return entry


@dataclass(frozen=True, kw_only=True)
class Purchase:
    """The manoeuvre whose runs are most informative about a parameter."""

    primitive: str  # its name; "" where no single manoeuvre matters
    runs: int  # number of its runs in the plan
    # ratio of the standard deviations of the parameter without and with them; inf where it is not estimable without
    # them
    without: float


@sealed(pose="3", before="p", now="p", stated="p", so_far="p", after="p")
class Known:
    """The state of a trial in progress."""

    data: tuple[str, ...]  # files so far
    sailed_s: float  # time in them [s]
    total_s: float  # informative time of the whole trial [s]
    remaining_s: float  # informative time left [s]; nan where it is as long as the accuracy asked for takes
    remaining_stated: bool  # whether the user stated it
    pose: Array  # (3,) of the ship at the end of the data, in the area's frame
    speed_mps: float  # over ground in the last sample
    model: str  # origin of the model for the rest
    environment: Environment  # current and wind of the rest
    weather: str  # their origin
    notes: tuple[str, ...]  # further remarks, one sentence each
    parameters: tuple[str, ...]  # p names
    before: Array  # (p,) values before the trial, nan for parameters that the model did not have
    now: Array  # (p,) values now
    stated: Array  # (p,) standard deviations stated before the trial, 0 where none was
    so_far: Array  # (p,) of estimates from the data so far, predicted; nan where it is not estimable
    after: Array  # (p,) likewise from these data and the rest together
    purchases: tuple[Purchase, ...]  # (p,) most informative runs
    under_way: UnderWay | None = None  # how the ship moves as the rest begins; None where it is assumed to be stopped

    @property
    def new(self) -> tuple[str, ...]:
        """Parameters that the model did not have before the trial."""
        return tuple(name for name, value in zip(self.parameters, self.before, strict=True) if math.isnan(value))


def replan_json(known: Known) -> str:
    """Content of replan.json; numbers that are not finite are null."""
    columns = zip(
        known.parameters,
        *(column.tolist() for column in (known.before, known.now, known.stated, known.so_far, known.after)),
        known.purchases,
        strict=True,
    )
    moves = known.under_way
    current, wind = known.environment.current_to.tolist(), known.environment.wind_to.tolist()
    return strict_json(
        {
            **entry(known, "data", "sailed_s", "remaining_s", "remaining_stated", "model", "notes"),
            "whole_trial_s": known.total_s,
            "start": dict(zip(POSE_COLUMNS, known.pose.tolist(), strict=True)),
            "measured_speed_mps": known.speed_mps,
            "begins_with": None if moves is None else dict(zip(VELOCITY_COLUMNS, moves.velocity.tolist(), strict=True)),
            "environment": {
                "from": known.weather,
                "current_to": {"north_mps": current[0], "east_mps": current[1]},
                "wind_to": {"north_mps": wind[0], "east_mps": wind[1]},
            },
            "parameters": {name: _entry(*row) for name, *row in columns},
        }
    )


def _entry(before: float, now: float, stated: float, so_far: float, after: float, purchase: Purchase) -> dict[str, Any]:
    return {
        "before": finite(before),
        "now": now,
        "std_before": stated or None,
        "std_so_far": finite(so_far),
        "std_after_rest": finite(after),
        "bought_by": purchase.primitive or None,
        "std_ratio_without_it": finite(purchase.without),
    }
