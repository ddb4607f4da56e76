"""A design from labelled, recorded data: its dictionary as dictionary.json, its draws as subsets.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from expdesign.export.files.text import finite, named_finite, strict_json
from expdesign.information.moments import log_det_or_none
from expdesign.information.recorded import BatchInformation
from expdesign.rehearsal import Drawn


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
            "samples": item.samples,
            "X": item.X.tolist(),
            "Y": item.Y.tolist(),
            "Z": item.Z.tolist(),
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
    version: str,
) -> str:
    """Draws of every design with their simulation errors; null where there is no estimate or its model diverges.

    Args:
        drawn: of each design.
        outputs: velocities that have equations.
        pieces, labels: of each piece.
        command: that gives the same.
        version: of the package.
    """
    return strict_json(
        {
            "pieces": [{"name": name, "label": label} for name, label in zip(pieces, labels, strict=True)],
            "designs": {item.design: _design(item, outputs) for item in drawn},
            "command": command,
            "version": version,
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
