"""The dictionary and the durations as dictionary.json and durations.json.

The dictionary holds motions in calm water, so velocities over ground and through water are the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from expdesign import __version__
from expdesign.conventions import VELOCITY_COLUMNS, to_b_frame, to_n_frame
from expdesign.dictionary.spec import Primitive, PrimitiveSpec
from expdesign.durations import DurationDesign, Efficiencies, bordered, limits_kept, pool_gains
from expdesign.export.files.text import (
    csv_text,
    entry,
    finite,
    named,
    named_finite,
    sample_seconds,
    strict_json,
    toml_comments,
    toml_table,
)
from expdesign.growing import Growth
from expdesign.information.moments import PrimitiveInformation, log_det_or_none
from expdesign.information.recorded import BatchInformation
from expdesign.rehearsal import Drawn
from expdesign.signals import Commands
from expdesign.vessel import Vessel, column_name


def dictionary_json(
    information: Sequence[PrimitiveInformation],
    parameters: Sequence[str],
    *,
    vessel: Vessel,
    mean_subtraction: str = "complete",
) -> str:
    """The dictionary with the information of each primitive, as dictionary.json.

    Args:
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
        **entry(primitive, "name", "family", "settings", "duration_s"),
        "start": named(VELOCITY_COLUMNS, primitive.entry_velocity),
        "end": named(VELOCITY_COLUMNS, primitive.exit_velocity),
        "displacement": {"forward_m": forward, "starboard_m": starboard, "turn_rad": turn},
        "footprint_radius_m": footprint_radius(primitive, vessel),
        "excitation_condition": bool(item.excitation_condition),
        "excitation_condition_by_equation": dict(item.excites),
        "excitation_share_by_equation": dict(item.clear_share),
        **entry(item, "X", "Y", "Z", "YZ", "log_det_alone"),
    }


def footprint_radius(primitive: Primitive, vessel: Vessel) -> float:
    """Largest distance of any point of the hull from the start point over the run [m]."""
    pose = primitive.trajectory.pose
    corners = np.concatenate([to_b_frame(to_n_frame(vessel.hull_b, sample), pose[0]) for sample in pose])
    return float(np.hypot(*corners.T).max())


def durations_json(design: DurationDesign, *, compared: Sequence[Efficiencies] = ()) -> str:
    """The design with its certificate, as durations.json; bounds are null where there are none.

    Args:
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
            **entry(design, "log_det", "log_det_bound", "gap", "gap_relative"),
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
            "efficiencies": {
                item.criterion: {"title": item.title, "designs": dict(item.of), "missing": item.missing or None}
                for item in compared
            },
        }
    )


def _certificate_entry(design: DurationDesign) -> dict[str, Any]:
    """No feasible durations have a criterion value above `bound`; sensitivity minus price is at most `level`."""
    proof = design.certificate
    return {
        "theorem": proof.kind,
        **entry(proof, "value", "bound", "degree", "level"),
        "mixture_of_models": proof.mixture.tolist() if design.problem.robust != "nominal" else None,
        "multipliers": dict(proof.multipliers),
        "guaranteed_log_det": finite(proof.guaranteed),
    }


def _solver_entry(design: DurationDesign) -> dict[str, Any] | None:
    """What found the fractions, before they were rounded to whole runs."""
    found = design.solver
    return None if found is None else {**asdict(found), "wall_s": round(found.wall_s, 3)}


def dictionary_files(
    specs: Sequence[PrimitiveSpec], *, name: str, stem: str, comments: Sequence[str] = ()
) -> dict[str, str | bytes]:
    """`<stem>.toml` and a CSV for each recorded primitive; reading them gives exactly the same requests.

    Args:
        stem: of the file names.
        comments: lines to go first.
    """
    lines = [*toml_comments(comments), *toml_table("[dictionary]", {"name": name})]
    files: dict[str, str | bytes] = {}
    for spec in specs:
        stated: dict[str, str | float] = {"name": spec.name, "family": spec.family, **spec.settings}
        if spec.commands is not None:
            file = stated["file"] = f"{stem}-{spec.name}.csv"
            files[file] = recorded_csv(spec.commands)
            del stated["duration_s"]
        lines += ["", *toml_table("[[primitives]]", stated)]
    return {f"{stem}.toml": "\n".join(lines) + "\n", **files}


def growth_json(growth: Growth) -> str:
    """Additions to a dictionary, the gain of each, and the guarantee of the search, as growth.json."""
    velocities = zip(("u_mps", "v_mps", "r_radps"), growth.limits.tolist(), strict=True)
    return strict_json(
        {
            "criterion": "D",
            "dimension": growth.dimension,
            "limits": dict(velocities),
            "candidates": growth.evaluated,
            "best_sensitivity_left": finite(growth.best_left),
            "efficiency_at_least_among_candidates": growth.efficiency_left,
            "rounds": [
                {
                    **entry(row, "name", "family", "settings"),
                    "sensitivity_before": row.sensitivity,
                    "sensitivity_of_family_member": row.searched,
                    "log_det_gain": row.log_det_gain,
                    "efficiency_so_far": row.efficiency,
                    "excitation_condition": row.excitation_condition,
                }
                for row in growth.rounds
            ],
        }
    )


def recorded_csv(commands: Commands) -> str:
    """Commands as a recorded primitive's file; no digit is lost."""
    rows = (
        (repr(sample_seconds(sample, commands.sample_time_s)), *(repr(value) for value in values))
        for sample, values in enumerate(commands.values.tolist())
    )
    return csv_text(("time_s", *(column_name(name) for name in commands.names)), rows)


def recorded_dictionary_json(
    dictionary: Sequence[BatchInformation],
    parameters: Sequence[str],
    *,
    outputs: Sequence[str],
    pieces: Mapping[str, int],
    gains: Sequence[float],
    mean_subtraction: str,
) -> str:
    """The labels with their information, in the keys of `dictionary_json` as far as data have them.

    Args:
        dictionary: moments of each label.
        parameters: (p) names in the order of the matrices.
        outputs: velocities that have equations.
        pieces: number of each label.
        gains: (q,) of each label beside the pool.
        mean_subtraction: for `log_det_alone`, of which the symmetric part of the information counts.
    """
    entries = [
        {
            "name": item.name,
            "family": "recorded",
            "pieces": pieces[item.name],
            "duration_s": item.seconds,
            **entry(item, "samples", "X", "Y", "Z"),
            "log_det_alone": _log_det(item, mean_subtraction),
            "gain_beside_pool": finite(gain),
        }
        for item, gain in zip(dictionary, gains, strict=True)
    ]
    return strict_json({"parameters": list(parameters), "outputs": list(outputs), "primitives": entries})


def _log_det(item: BatchInformation, mean_subtraction: str) -> float | None:
    taken = item.Y @ item.Z.T if mean_subtraction != "none" else np.zeros_like(item.X)
    information = (item.X - taken + (item.X - taken).T) / 2
    return log_det_or_none(information, np.abs(np.diag(item.X)))


def subsets_json(
    drawn: Sequence[Drawn],
    *,
    outputs: Sequence[str],
    pieces: Sequence[str],
    labels: Sequence[str],
    command: str,
) -> str:
    """Draws of every design with their simulation errors; null where there is no estimate or its model diverges.

    Args:
        outputs: velocities that have equations.
        pieces, labels: of each piece.
        command: that gives the same.
    """
    return strict_json(
        {
            "pieces": [{"name": name, "label": label} for name, label in zip(pieces, labels, strict=True)],
            "designs": {item.design: _design(item, outputs) for item in drawn},
            "command": command,
            "version": __version__,
        }
    )


def _design(item: Drawn, outputs: Sequence[str]) -> dict[str, Any]:
    middle, high = np.quantile(item.norm, [0.5, 0.95], method="higher")
    return {
        "degenerate": float(item.degenerate.mean()),
        "median_norm": finite(float(middle)),
        "norm_95_percent": finite(float(high)),
        "draws": [
            {
                "pieces": list(subset),
                "rmse": named_finite(outputs, rmse),
                "norm": finite(float(norm)),
                "degenerate": bool(wrong),
            }
            for subset, rmse, norm, wrong in zip(item.subsets, item.rmse, item.norm, item.degenerate, strict=True)
        ],
    }
