"""Work shared among processes is the same work: same results, same errors, on copies of what it was given."""

from operator import add, truediv

import numpy as np
import pytest
from joblib import parallel_config

from expdesign.errors import NoPlan
from expdesign.processes import in_order


def refuse(reason):
    raise NoPlan(reason)


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_tasks(jobs):
    with parallel_config(backend="loky", n_jobs=jobs):
        assert list(in_order(add, (10,), ((number,) for number in range(7)))) == list(range(10, 17))
        assert list(in_order(add, (), [])) == []


def test_others_work_on_copies_and_what_is_not_read_does_no_harm():
    numbers = np.arange(3.0)
    with parallel_config(backend="loky", n_jobs=2):
        results = in_order(truediv, (numbers,), ((float(number),) for number in range(1, 9)))
        numbers[:] = 7.0
        np.testing.assert_array_equal(next(results), [0.0, 1.0, 2.0])
        results.close()
        in_order(truediv, (numbers,), [(1.0,), (2.0,)])  # never read
        assert list(in_order(add, (1,), [(1,), (2,)])) == [2, 3]


@pytest.mark.parametrize("jobs", [1, 2])
def test_errors_reach_the_caller_as_they_are(jobs):
    with parallel_config(backend="loky", n_jobs=jobs):
        results = in_order(refuse, (), [("too narrow",)])
        with pytest.raises(NoPlan, match="too narrow"):
            next(results)


def test_one_process_works_only_when_asked():
    done = []
    results = in_order(done.append, (), [(1,), (2,)])
    assert done == []
    next(results)
    assert done == [1]
