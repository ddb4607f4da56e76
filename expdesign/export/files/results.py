"""Results as files: strict JSON in SI units, units in the names, and CSV with one header row.

Numbers in JSON and in commands.csv are written so that reading them back gives the same float. Velocities are over
ground in plan.json and track.csv; in dictionary.json, which holds motions in calm water, ground and water are the same.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from expdesign.conventions import POSE_COLUMNS, VELOCITY_COLUMNS, to_b_frame, to_n_frame
from expdesign.dictionary.primitive import Primitive
from expdesign.durations import DurationDesign, Efficiencies, limits_kept
from expdesign.export.routes import build_fence, require_verified
from expdesign.information.primitive_information import PrimitiveInformation
from expdesign.plan.values import Leg, Plan, Promise
from expdesign.simulation.environment import Environment
from expdesign.values import Array
from expdesign.vessel import Variation, Vessel, column_name

FRAME_SENTENCE = (
    "north_m and east_m are the northing and easting of the projection, in metres from the origin; "
    "latitude and longitude are WGS84; heading_rad is clockwise from north_m"
)
METRE_DECIMALS, MOTION_DECIMALS, DEGREE_DECIMALS, TIME_DECIMALS = 6, 9, 9, 9


def dictionary_json(information: Sequence[PrimitiveInformation], parameters: Sequence[str], *, vessel: Vessel) -> str:
    """The dictionary with the information of each primitive, as dictionary.json.

    Args:
        information: of each primitive.
        parameters: (p) names in the order of the matrices.
        vessel: its model says which velocities have equations, its hull gives the footprint.
    """
    return strict_json(
        {
            "parameters": list(parameters),
            "outputs": list(vessel.model.outputs),
            "primitives": [_primitive_entry(item, vessel) for item in information],
        }
    )


def _primitive_entry(item: PrimitiveInformation, vessel: Vessel) -> dict[str, Any]:
    primitive = item.primitive
    forward, starboard, turn = primitive.displacement.tolist()
    return {
        "name": primitive.name,
        "family": primitive.family,
        "settings": dict(primitive.settings),
        "duration_s": primitive.duration_s,
        "start": _named(VELOCITY_COLUMNS, primitive.entry_velocity),
        "end": _named(VELOCITY_COLUMNS, primitive.exit_velocity),
        "displacement": {"forward_m": forward, "starboard_m": starboard, "turn_rad": turn},
        "footprint_radius_m": footprint_radius(primitive, vessel),
        "excitation_condition": bool(item.excitation_condition),
        "X": item.X.tolist(),
        "Y": item.Y.tolist(),
        "Z": item.Z.tolist(),
        "YZ": item.YZ.tolist(),
        "log_det_alone": item.log_det_alone,
    }


def footprint_radius(primitive: Primitive, vessel: Vessel) -> float:
    """Largest distance of any point of the hull from the start point over the run [m]."""
    pose = primitive.trajectory.pose
    corners = np.concatenate([to_b_frame(to_n_frame(vessel.hull_b, sample), pose[0]) for sample in pose])
    return float(np.hypot(*corners.T).max())


def durations_json(design: DurationDesign, *, compared: Sequence[Efficiencies] = ()) -> str:
    """The design with its certificate, as durations.json; bounds are null where there are none.

    Args:
        design: the durations.
        compared: the design under every criterion.
    """
    problem = design.problem
    columns = zip(
        problem.names,
        design.fractions.tolist(),
        design.durations_s.tolist(),
        design.repeats,
        design.sensitivities.tolist(),
        design.certificate.prices.tolist(),
        strict=True,
    )
    keys = ("name", "fraction", "duration_s", "repeats", "sensitivity", "price")
    return strict_json(
        {
            "criterion": problem.aim.criterion,
            "mean_subtraction": problem.mean_subtraction,
            "total_s": problem.total_s,
            "log_det": design.log_det,
            "log_det_bound": _finite(design.log_det_bound),
            "gap": _finite(design.gap),
            "gap_relative": _finite(design.gap_relative),
            "dimension": problem.dimension,
            "parameters": list(problem.parameters),
            "primitives": [dict(zip(keys, row, strict=True)) for row in columns],
            "efficiency": {
                "continuous": 1.0,
                "repeats": design.efficiency_repeats,
                "uniform": design.efficiency_uniform,
            },
            "certificate": _certificate_entry(design),
            "robust": problem.robust,
            "models": len(problem.sampled),
            "interest": list(problem.aim.interest or problem.parameters),
            "outcomes": list(problem.aim.outcomes),
            "prior_information": bool(problem.prior.any()),
            "limits": [vars(kept) for kept in limits_kept(design)],
            "efficiencies": {item.criterion: _efficiency_entry(item) for item in compared},
        }
    )


def _certificate_entry(design: DurationDesign) -> dict[str, Any]:
    """No feasible durations have a criterion value above `bound`; sensitivity minus price is at most `level`."""
    proof = design.certificate
    return {
        "theorem": proof.kind,
        "value": proof.value,
        "bound": _finite(proof.bound),
        "degree": proof.degree,
        "level": proof.level,
        "mixture_of_models": proof.mixture.tolist() if design.problem.robust != "nominal" else None,
        "multipliers": dict(proof.multipliers),
        "guaranteed_log_det": _finite(proof.guaranteed),
    }


def _efficiency_entry(item: Efficiencies) -> dict[str, Any]:
    return {"title": item.title, "designs": dict(item.of), "missing": item.missing or None}


def plan_json(plan: Plan, *, scenario: str, vessel: Vessel, environment: Environment, clearance_m: float) -> str:
    """The plan, leg by leg, with the results of the independent check, as plan.json.

    Args:
        plan: verified.
        scenario: its name.
        vessel: for name and particulars.
        environment: the forecast it was planned for.
        clearance_m: the required clearance [m].

    Raises:
        NoPlan: the plan is not verified.
    """
    require_verified(plan)
    check, frame = plan.verification, plan.area.frame
    return strict_json(
        {
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
            "legs": [_leg_entry(plan, index, leg) for index, leg in enumerate(plan.legs)],
            "informative_s": plan.seconds("primitive"),
            "reposition_s": plan.seconds("reposition"),
            "reposition_bound_s": plan.reposition_bound_s,
            "clearance_min_m": check.clearance_min_m,
            "clearance_required_m": clearance_m,
            "fence": _fence_entry(plan, vessel, clearance_m),
            "leave_water_probability": plan.leave_water_probability,
            "drawn_trials": _promise_entry(plan.promise),
            "design_efficiency_placed": plan.design_efficiency_placed,
            "design_efficiency_realised": plan.design_efficiency_realised,
            "verified": check.verified,
            "verification": {
                "clearance_time_s": check.clearance_time_s,
                "reproduction_error_m": check.reproduction_error_m,
                "limit_excess": check.limit_excess,
                "problems": list(check.problems),
            },
        }
    )


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


def _promise_entry(promise: Promise | None) -> dict[str, Any] | None:
    """Results of the Monte Carlo trials: shares of all trials, times in addition to the plan."""
    if promise is None:
        return None
    return {
        "trials": promise.trials,
        "leave_water_share": promise.left,
        "leave_water_standard_error": promise.error,
        "leave_water_upper_95": promise.left_most,
        "aborted_share": promise.aborted,
        "aborted_where": list(promise.reasons),
        "note_on_broken_off": promise.note or None,
        "extra_time_median_s": _finite(promise.extra_median_s),
        "extra_time_95_s": _finite(promise.extra_most_s),
        "goes_round_at_most": promise.rounds,
        "run_begins_within": {
            "heading_rad": promise.heading_rad,
            "velocity_mps": promise.speed_mps,
            "yaw_rate_radps": promise.yaw_rate_radps,
        },
    }


def _sailed_entry(plan: Plan, index: int) -> dict[str, float | None]:
    """Results of the Monte Carlo trials on a leg."""
    if plan.promise is None:
        return {"leave_water_probability": dict(enumerate(plan.leave_water_by_leg)).get(index)}
    leg = plan.promise.legs[index]
    return {
        "leave_water_probability": leg.left,
        "begins_within_m": leg.position_m,
        "aborted_share": leg.aborted,
        "goes_round_mean": leg.rounds,
        "sailed_median_s": leg.median_s,
        "sailed_95_s": leg.most_s,
    }


def _leg_entry(plan: Plan, index: int, leg: Leg) -> dict[str, Any]:
    return {
        "index": index,
        "kind": leg.kind,
        "name": leg.name,
        "start": _state(plan, leg.first),
        "end": _state(plan, leg.last),
        "duration_s": sample_seconds(leg.last - leg.first, plan.commands.sample_time_s),
        **_sailed_entry(plan, index),
    }


def _state(plan: Plan, sample: int) -> dict[str, float]:
    return {
        "time_s": sample_seconds(sample, plan.commands.sample_time_s),
        **_named(POSE_COLUMNS, plan.trajectory.pose[sample]),
        **_named(VELOCITY_COLUMNS, plan.trajectory.velocity[sample]),
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


def csv_text(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """CSV of plain cells: names, numbers, no quoting needed."""
    return "\n".join(",".join(row) for row in (header, *rows)) + "\n"


def strict_json(value: object) -> str:
    """Readable JSON without NaN or infinity; rows of numbers stay on one line."""
    text = json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False)
    # a raw line break never occurs inside a JSON string, so only lists of numbers are joined
    return re.sub(r"\[\n\s+([^\[\]{}\"]*?)\n\s*\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"


def sample_seconds(sample: int, sample_time_s: float) -> float:
    """Time of a sample [s], free of the last bits that multiplication adds."""
    return round(sample * sample_time_s, TIME_DECIMALS)


def _time(sample: int, sample_time_s: float) -> str:
    return repr(sample_seconds(sample, sample_time_s))


def _named(columns: Sequence[str], values: Array) -> dict[str, float]:
    return dict(zip(columns, values.tolist(), strict=True))


def _wind_or_current(velocity: Array, std_mps: float, variation: Variation) -> dict[str, float]:
    entry = {"north_mps": float(velocity[0]), "east_mps": float(velocity[1]), "std_mps": std_mps}
    if variation.std_mps:
        entry |= {"variation_std_mps": variation.std_mps, "correlation_s": variation.correlation_s}
    return entry


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
