"""Planning does no more work than it did: solves, iterations, samples, steps and geometry calls, by phase.

Samples are those of single ships; samples of few ships count each ship; steps of many ships count once for all.

Limits are a third above what was counted when they were set, as searches differ a little from machine to machine.
"""

import pytest

from short_examples import example_work

LIMITS = {
    "harbour": {
        "water": {"geometry calls": 260, "steps of many ships": 1070},
        "placing and legs": {"samples": 5850, "geometry calls": 105, "solves": 30, "iterations": 860},
        "checks": {
            "samples": 2310,
            "geometry calls": 1770,
            "steps of many ships": 5320,
            "samples of few ships": 46_400,
        },
        "files": {"geometry calls": 240, "samples": 3900, "steps of many ships": 2130},
    },
    "model-ship": {
        "water": {"geometry calls": 145, "steps of many ships": 2400},
        "transitions": {"geometry calls": 3, "solves": 33, "iterations": 1040},
        "placing and legs": {"geometry calls": 340, "samples": 3600, "solves": 11, "iterations": 430},
        "checks": {
            "samples": 1530,
            "geometry calls": 1380,
            "steps of many ships": 3910,
            "samples of few ships": 67_700,
        },
        "files": {"geometry calls": 125, "samples": 2730, "steps of many ships": 4800},
    },
}


@pytest.mark.thorough
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
