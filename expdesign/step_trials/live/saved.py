"""A trial that is being sailed out of its file, to the last bit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from expdesign.step_trials.live.step_list import Inputs, Listed
from expdesign.step_trials.live.values import Finished, Held, Row, State
from expdesign.step_trials.samples import Plateau
from expdesign.step_trials.steady_state import RatioTest, Watched


def restored_state(table: Mapping[str, Any]) -> State:
    """A state, read from plain values.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: it is none.
    """
    tests, held, before = table["tests"], table["held"], table["before"]
    return State(
        left=_listed(table["left"]),
        finished=tuple(_finished(one) for one in table["finished"]),
        left_out=_listed(table["left_out"]),
        sample_time_s=table["sample_time_s"],
        tests=None if tests is None else (_test(tests[0]), _test(tests[1])),
        watched=tuple(Watched(**{**one, "part": tuple(one["part"])}) for one in table["watched"]),
        held=None if held is None else _held(held),
        before=None if before is None else (_inputs(before[0]), _plateau(before[1])),
        skipped=table["skipped"],
    )


def _inputs(values: list[float]) -> Inputs:
    return tuple(map(float, values))


def _listed(tables: list[dict[str, Any]]) -> tuple[Listed, ...]:
    return tuple(_step(one) for one in tables)


def _step(table: dict[str, Any]) -> Listed:
    return Listed(**{**table, "before": _inputs(table["before"]), "after": _inputs(table["after"])})


def _finished(table: dict[str, Any]) -> Finished:
    return Finished(**{**table, "state": tuple(table["state"]), "state_std": tuple(map(float, table["state_std"]))})


def _test(table: dict[str, Any]) -> RatioTest:
    return RatioTest(**table)


def _held(table: dict[str, Any]) -> Held:
    rows = tuple(
        Row(time_s=float(row["time_s"]), motion=tuple(map(float, row["motion"])), inputs=_inputs(row["inputs"]))  # type: ignore[arg-type]
        for row in table["rows"]
    )
    step, inputs, changed = table["step"], table["inputs"], table["changed"]
    return Held(
        **{
            **table,
            "rows": rows,
            "inputs": None if inputs is None else _inputs(inputs),
            "step": None if step is None else _step(step),
            "changed": (bool(changed[0]), bool(changed[1])),
        }
    )


def _plateau(table: dict[str, Any]) -> Plateau:
    return Plateau(
        state=np.array(table["state"], dtype=float),
        std=np.array(table["std"], dtype=float),
        sway=float(table["sway"]),
        sway_std=float(table["sway_std"]),
        inputs=np.array(table["inputs"], dtype=float),
        turns=int(table["turns"]),
        duration_s=float(table["duration_s"]),
        course=np.array(table["course"], dtype=float),
    )
