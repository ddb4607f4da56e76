"""The dictionary and the durations as dictionary.json and durations.json.

The dictionary holds motions in calm water, so velocities over ground and through water are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from expdesign.conventions import VELOCITY_COLUMNS, to_b_frame, to_n_frame
from expdesign.dictionary.primitive import Primitive
from expdesign.durations import DurationDesign, Efficiencies, bordered, limits_kept, pool_gains
from expdesign.export.files.text import finite, named, strict_json
from expdesign.information.primitive_information import PrimitiveInformation
from expdesign.vessel import Vessel


def dictionary_json(
    information: Sequence[PrimitiveInformation],
    parameters: Sequence[str],
    *,
    vessel: Vessel,
    mean_subtraction: str = "complete",
) -> str:
    """The dictionary with the information of each primitive, as dictionary.json.

    Args:
        information: of each primitive.
        parameters: (p) names in the order of the matrices.
        vessel: its model says which velocities have equations, its hull gives the footprint.
        mean_subtraction: by which primitives are ranked beside all others.
    """
    gains = pool_gains(np.array([bordered(item, mean_subtraction) for item in information]))
    return strict_json(
        {
            "parameters": list(parameters),
            "outputs": list(vessel.model.outputs),
            "primitives": [
                {**_primitive_entry(item, vessel), "gain_beside_pool": finite(gain)}
                for item, gain in zip(information, gains.tolist(), strict=True)
            ],
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
        "start": named(VELOCITY_COLUMNS, primitive.entry_velocity),
        "end": named(VELOCITY_COLUMNS, primitive.exit_velocity),
        "displacement": {"forward_m": forward, "starboard_m": starboard, "turn_rad": turn},
        "footprint_radius_m": footprint_radius(primitive, vessel),
        "excitation_condition": bool(item.excitation_condition),
        "excitation_condition_by_equation": dict(item.excites),
        "excitation_share_by_equation": dict(item.clear_share),
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
    held = [{"excitation_condition_by_equation": dict(own)} for own in problem.excites] or [{}] * len(problem.names)
    return strict_json(
        {
            "criterion": problem.aim.criterion,
            "mean_subtraction": problem.mean_subtraction,
            "total_s": problem.total_s,
            "log_det": design.log_det,
            "log_det_bound": finite(design.log_det_bound),
            "gap": finite(design.gap),
            "gap_relative": finite(design.gap_relative),
            "dimension": problem.dimension,
            "parameters": list(problem.parameters),
            "primitives": [
                {**dict(zip(keys, row, strict=True)), **own} for row, own in zip(columns, held, strict=True)
            ],
            "excitation": problem.excitation,
            "efficiency": {
                "continuous": 1.0,
                "repeats": design.efficiency_repeats,
                "uniform": design.efficiency_uniform,
            },
            "certificate": _certificate_entry(design),
            "solver": _solver_entry(design),
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
        "bound": finite(proof.bound),
        "degree": proof.degree,
        "level": proof.level,
        "mixture_of_models": proof.mixture.tolist() if design.problem.robust != "nominal" else None,
        "multipliers": dict(proof.multipliers),
        "guaranteed_log_det": finite(proof.guaranteed),
    }


def _solver_entry(design: DurationDesign) -> dict[str, Any] | None:
    """What found the fractions, before they were rounded to whole runs."""
    found = design.solver
    return None if found is None else {**asdict(found), "wall_s": round(found.wall_s, 3)}


def _efficiency_entry(item: Efficiencies) -> dict[str, Any]:
    return {"title": item.title, "designs": dict(item.of), "missing": item.missing or None}
