"""The plan as plan.json, track.csv and commands.csv.

Numbers in plan.json and commands.csv are written so that reading them back gives the same float. Velocities are over
ground.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from expdesign.conventions import POSE_COLUMNS, VELOCITY_COLUMNS
from expdesign.export.files.accuracy import PlannedAccuracy, accuracy_entries
from expdesign.export.files.text import csv_text, finite, named, sample_seconds, strict_json
from expdesign.export.routes import build_fence, require_verified
from expdesign.plan.values import LatticeProof, Leg, Plan, RiskEstimate
from expdesign.simulation.environment import Environment
from expdesign.values import Array
from expdesign.vessel import Variation, Vessel, column_name

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
SKETCHED, SKETCH_DECIMALS = 40, 5  # places of a leg of a draft, and decimals of their degrees


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
        scenario: its name.
        vessel: for name and particulars.
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
            "vessel": {"name": vessel.name, "length_m": vessel.length_m, "beam_m": vessel.beam_m},
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
            "design_efficiency_placed": plan.design_efficiency_placed,
            "design_efficiency_realised": plan.design_efficiency_realised,
            **({} if check.heel_max_rad is None else {"heel_max_rad": check.heel_max_rad}),
            "verified": plan.verified,
            "verdict": plan.verdict,
            "verification": {
                "clearance_time_s": check.clearance_time_s,
                "reproduction_error_m": check.reproduction_error_m,
                "limit_excess": check.limit_excess,
                "problems": list(check.problems),
            },
        }
    )


def _lattice_entry(proof: LatticeProof) -> dict[str, Any]:
    """The proof of the lattice planner, and its scope."""
    return {
        "spacing_m": proof.spacing_m,
        "headings": proof.headings,
        "cost_s": proof.cost_s,
        "lower_bound_s": proof.lower_bound_s,
        "gap": proof.gap,
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
    """Latitude and longitude of some places of a leg, enough for a drawing and too few and too coarse to sail by."""
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
