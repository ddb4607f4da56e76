"""Legs found before the runs between them are sailed: one for each task, whatever is known of it."""

from types import SimpleNamespace

import numpy as np
import pytest

from expdesign.plan.legs_ahead import KnownLegs, legs_ahead
from expdesign.plan.values import WorkBudget


class Straight:
    """Stands for a planner: the commands of a leg are its start."""

    def leg(self, task, water):
        return SimpleNamespace(commands=task.start[None], source="straight")


def task(place: float) -> SimpleNamespace:
    start = np.array([place])
    return SimpleNamespace(
        start=start, end=start, start_inputs=start, end_inputs=start, past=start, budget=WorkBudget(most_s=1.0)
    )


@pytest.mark.parametrize("places", [[1.0, 2.0, 2.0], [2.0, 2.0], [1.0, 1.0, 3.0, 2.0, 3.0], []])
def test_runs_that_end_where_they_began_have_equal_legs_between_them(places):
    """Each leg is sought once, and returned as often as it is to be sailed."""
    known = KnownLegs()
    for _ in range(2):
        found = list(legs_ahead(Straight(), None, [task(place) for place in places], known))
        assert [float(leg.commands[0, 0]) for leg in found] == places
    assert len(known) == len(set(places))
    assert [leg.source for leg in legs_ahead(Straight(), None, map(task, places))] == ["straight"] * len(places)
