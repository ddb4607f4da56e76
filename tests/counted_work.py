"""Work counted by phase while a trial is planned: what is done, not how long it takes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import shapely

from expdesign.plan.legs._casadi import Program
from expdesign.progress import Progress
from expdesign.simulation._casadi import CompiledIntegrator, CompiledSample
from expdesign.simulation.program import RatesProgram

GEOMETRY = ("buffer", "contains", "contains_properly", "contains_xy", "covers", "convex_hull", "difference", "distance")
PHASES = {
    "measuring the water": "water",
    "trying transitions between runs": "transitions",
    "placing runs": "placing and legs",
    "verifying": "checks",
    "sailing drawn trials": "checks",
    "writing routes, run cards and report": "files",
}
"""Activities that begin a phase; the legs are found while runs are sailed."""

Counts = dict[str, dict[str, int]]


@contextmanager
def counted_work() -> Iterator[tuple[Counts, Progress]]:
    """Counts by phase and kind, filled in while the block runs, and the progress to give to the command."""
    counts: Counts = defaultdict(lambda: defaultdict(int))
    phase = ["design"]

    def progress(activity: str, share: float) -> None:
        phase[0] = PHASES.get(activity.rpartition(": ")[2], phase[0])

    def counting(call: Callable, count: Callable[..., dict[str, int]]) -> Callable:
        def counted(*arguments: Any, **options: Any) -> Any:
            result = call(*arguments, **options)
            for kind, number in count(*arguments).items():
                counts[phase[0]][kind] += number
            return result

        return counted

    with pytest.MonkeyPatch.context() as patch:
        for owner, name, count in (
            (Program, "solve", lambda solver, *_: {"solves": 1, "iterations": solver.solver.stats()["iter_count"]}),
            (CompiledIntegrator, "states", lambda _, start, delivered, *__: {"samples": len(delivered)}),
            (CompiledSample, "states", lambda _, start, *__: {"samples of few ships": len(start)}),
            (RatesProgram, "rk4", lambda *_: {"steps of many ships": 1}),
            *((shapely, name, lambda *_: {"geometry calls": 1}) for name in GEOMETRY),
        ):
            patch.setattr(owner, name, counting(getattr(owner, name), count))
        yield counts, progress
