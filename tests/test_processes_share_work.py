"""Work shared among processes is the same work: same results, same errors, on copies of what it was given."""

import pickle
from operator import add, truediv

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.errors import FileError, InputError, NoPlan, NotInformative, SpeedOutOfReach, UnknownName
from expdesign.processes import as_finished, in_order, local_processes
from expdesign.workflows.steps.workers import workers


def refuse(reason):
    raise NoPlan(reason)


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_tasks(jobs):
    with local_processes(jobs):
        assert list(in_order(add, (10,), ((number,) for number in range(7)))) == list(range(10, 17))
        assert list(in_order(add, (), [])) == []


def test_others_work_on_copies_and_what_is_not_read_does_no_harm():
    numbers = np.arange(3.0)
    with local_processes(2):
        results = in_order(truediv, (numbers,), ((float(number),) for number in range(1, 9)))
        numbers[:] = 7.0
        np.testing.assert_array_equal(next(results), [0.0, 1.0, 2.0])
        results.close()
        in_order(truediv, (numbers,), [(1.0,), (2.0,)])  # never read
        assert list(in_order(add, (1,), [(1,), (2,)])) == [2, 3]


@pytest.mark.parametrize("jobs", [1, 2])
def test_errors_reach_the_caller_as_they_are(jobs):
    with local_processes(jobs):
        results = in_order(refuse, (), [("too narrow",)])
        with pytest.raises(NoPlan, match="too narrow"):
            next(results)


@pytest.mark.parametrize(
    "error",
    [
        NoPlan("too narrow"),
        FileError("a.toml", "plan.clearance_m", "is -1, expected 0 or more"),
        UnknownName("criterion", "F", known=("A", "D")),
        SpeedOutOfReach("too fast", reached_mps=3.0),
        NotInformative("blind", parameters=("Xuu",)),
    ],
)
def test_errors_are_copied_with_what_they_say(error):
    copied = pickle.loads(pickle.dumps(error))
    assert (type(copied), str(copied), vars(copied)) == (type(error), str(error), vars(error))


def test_results_may_come_as_they_are_finished():
    with local_processes(2):
        assert sorted(as_finished(add, (10,), ((number,) for number in range(7)))) == list(range(10, 17))


def test_a_negative_number_of_processes_is_refused_in_one_line(tmp_path, capsys):
    for command in ("run", "plan", "validate"):
        assert main([command, "scenario.toml", "--jobs", "-3", "--out", str(tmp_path / "out")]) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert "--jobs" in line
        assert "-3" in line
    with pytest.raises(InputError, match="--jobs is -3, expected"), workers(-3):
        pass
    assert not (tmp_path / "out").exists()


def test_one_process_works_only_when_asked():
    done = []
    results = in_order(done.append, (), [(1,), (2,)])
    assert done == []
    next(results)
    assert done == [1]
