"""Planning does no more work than it did: solves, iterations, samples, steps and geometry calls, by phase.

Limits are a third above what was counted when they were set, as searches differ a little from machine to machine.
"""

import pytest

from short_examples import example_work

LIMITS = {
    "harbour": {
        "water": {"geometry calls": 270, "steps of many ships": 1100},
        "placing and legs": {"samples": 5900, "geometry calls": 110, "solves": 32, "iterations": 1100},
        "checks": {"samples": 2400, "geometry calls": 1800, "steps of many ships": 9800},
        "files": {"geometry calls": 360, "samples": 4000, "steps of many ships": 2200},
    },
    "model-ship": {
        "water": {"geometry calls": 150, "steps of many ships": 2400},
        "transitions": {"geometry calls": 5, "solves": 26, "iterations": 860},
        "placing and legs": {"geometry calls": 330, "samples": 3600, "solves": 13, "iterations": 380},
        "checks": {"samples": 1600, "geometry calls": 900, "steps of many ships": 8100},
        "files": {"geometry calls": 260, "samples": 2800, "steps of many ships": 4800},
    },
}


@pytest.mark.parametrize("name", LIMITS)
def test_no_phase_does_more_than_its_limit(made_once, name):
    done = example_work(made_once, name)
    assert done.keys() <= LIMITS[name].keys() | {"design"}
    excess = {
        (phase, kind): (count, LIMITS[name][phase].get(kind, 0))
        for phase, counts in done.items()
        for kind, count in counts.items()
        if phase != "design" and count > LIMITS[name][phase].get(kind, 0)
    }
    assert not excess, "done and limit"


@pytest.mark.parametrize("name", LIMITS)
def test_the_work_is_what_the_phases_are_for(made_once, name):
    done = example_work(made_once, name)
    assert done["placing and legs"]["solves"] > 0
    assert done["checks"]["steps of many ships"] > 0
    assert not any("solves" in counts for phase, counts in done.items() if phase in ("water", "checks", "files"))
