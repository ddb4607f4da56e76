"""A dictionary as a dictionary file, with a CSV of commands for every recorded primitive."""

from __future__ import annotations

import json
from collections.abc import Sequence

from expdesign.dictionary.spec import PrimitiveSpec
from expdesign.export.files.text import csv_text, finite, sample_seconds, strict_json
from expdesign.growing import Growth
from expdesign.signals import Commands
from expdesign.vessel import column_name


def dictionary_files(
    specs: Sequence[PrimitiveSpec], *, name: str, stem: str, comments: Sequence[str] = ()
) -> dict[str, str | bytes]:
    """`<stem>.toml` and a CSV for each recorded primitive; reading them gives exactly the same requests.

    Args:
        specs: requests.
        name: of the dictionary.
        stem: of the file names.
        comments: lines to go first.
    """
    lines = [f"# {line}".rstrip() for line in comments] + ["[dictionary]", f"name = {json.dumps(name)}"]
    files: dict[str, str | bytes] = {}
    for spec in specs:
        settings = dict(spec.settings)
        lines += ["", "[[primitives]]", f"name = {json.dumps(spec.name)}", f"family = {json.dumps(spec.family)}"]
        if spec.commands is not None:
            file = f"{stem}-{spec.name}.csv"
            files[file] = recorded_csv(spec.commands)
            lines.append(f"file = {json.dumps(file)}")
            del settings["duration_s"]
        lines += [f"{key} = {value!r}" for key, value in settings.items()]
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
                    "name": row.name,
                    "family": row.family,
                    "settings": dict(row.settings),
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
