"""Tasks in other processes tell how far they are to the process that waits for them."""

import time

import numpy as np
import pytest

from expdesign.processes import as_finished, local_processes, reported_together
from expdesign.processes.sharing import _elapsed

STEPS = 4


def told_work(name, progress):
    for step in range(STEPS):
        progress(f"{name} at work", np.float64(step) / STEPS)
        time.sleep(0.3)  # the one that waits looks more often
    return step


@pytest.mark.parametrize("jobs", [1, 2])
def test_shares_of_all_tasks_are_told_together_and_never_fall(jobs):
    told = []
    with local_processes(jobs), reported_together(lambda *what: told.append(what), 2) as together:
        for number in as_finished(told_work, (), zip("ab", together.reporters, strict=True)):
            assert number == STEPS - 1
    activities, shares = zip(*told, strict=True)
    assert set(activities) == {"a at work", "b at work"}
    assert shares == tuple(sorted(shares))
    assert max(shares) <= (STEPS - 1) / STEPS
    assert len(set(shares)) > 2  # more than two finished tasks could tell


def test_the_share_is_that_of_the_time():
    two_of_three_at_once = [_elapsed(done, 3, 2) for done in (0.0, 1.0, 2.0, 2.5, 3.0)]
    assert two_of_three_at_once == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert _elapsed(1.5, 4, 2) == 1.5 / 4
    assert _elapsed(1.0, 2, 8) == 1.0 / 2


def test_a_finished_task_is_told_at_once():
    told = []
    with reported_together(lambda *what: told.append(what), 2) as together:
        together.finished(1, "b is done")
        assert told == [("b is done", 0.5)]


def test_tasks_without_a_way_back_work_in_silence(tmp_path):
    with reported_together(lambda *_: None, 1) as together:
        (reporter,) = together.reporters
    reporter("at work", 0.5)  # as on another machine: the file is not there
    assert not reporter.path.exists()
