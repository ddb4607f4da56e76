"""Work shared among processes is the same work: same results, same errors, on copies of what it was given."""

import gc
import os
import pickle
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import permutations, product
from operator import add, truediv

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.errors import FileError, InputError, NoPlan, NotInformative, SpeedOutOfReach, UnknownName
from expdesign.processes import as_finished, in_order, local_processes
from expdesign.workflows.outcome import workers

pytestmark = pytest.mark.usefixtures("undrawn")

MANY = 30  # tasks, more than are begun at once
WAYS = (in_order, as_finished)


@pytest.fixture(scope="module", params=[1, 2, pytest.param(3, marks=pytest.mark.thorough)])
def jobs(request: pytest.FixtureRequest) -> Iterator[int]:
    with local_processes(request.param):
        yield request.param


KEPT = []  # what a process keeps


def refuse(reason):
    raise NoPlan(reason)


def refuse_one(refused, number):
    if number == refused:
        raise NoPlan(f"{number} is too narrow")
    return number


def die_of(deadly, number):
    if number == deadly:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def late(seconds):
    time.sleep(seconds)
    return seconds


def marked(folder, number, seconds=0.01):
    """A task that leaves a mark, of the process that does it."""
    (folder / f"{os.getpid()}-{number}").touch()
    return late(seconds)


def squares_below(count):
    """A task that shares work itself."""
    return list(in_order(pow, (), [(number, 2) for number in range(count)]))


def numbers(first, count=MANY, share=in_order):
    """Shared work whose results are so many numbers from `first` on."""
    return share(add, (first,), [(number,) for number in range(count)])


def close(work):
    work.pop().close()


def drop(work):
    work.clear()


def drop_in_a_circle(work):
    work.append(work)
    del work
    gc.collect()


def fail_between(work):
    with pytest.raises(ZeroDivisionError):
        next(work.pop()) / 0.0


@pytest.mark.usefixtures("jobs")
def grown_by(megabytes):
    """The process, and how many such things it keeps by now."""
    KEPT.append(np.ones(megabytes * 125_000))
    time.sleep(0.6)  # loky looks once a second
    return os.getpid(), len(KEPT)


@pytest.mark.optional  # without psutil, which the extras bring, loky does not know how large a process is
def test_a_process_that_keeps_what_it_built_goes_on():
    with local_processes(2):
        found = list(in_order(grown_by, (), [(1,), (1,), *[(150,)] * 6]))
    assert len({process for process, _ in found}) == 2  # not replaced
    assert max(kept for _, kept in found) >= 4  # one of them has grown by 450 MB or more, over loky's 300


def test_results_come_in_the_order_of_the_tasks():
    assert list(in_order(add, (10,), ((number,) for number in range(7)))) == list(range(10, 17))
    assert list(in_order(add, (), [])) == []


def test_results_may_come_as_they_are_finished(jobs):
    found = list(as_finished(late, (), [(1.0,), *[(0.0,)] * 9]))
    assert found == ([*[0.0] * 9, 1.0] if jobs > 1 else [1.0, *[0.0] * 9])


def test_others_work_on_copies_and_what_is_not_read_does_no_harm():
    numbers = np.arange(3.0)
    with local_processes(2):
        results = in_order(truediv, (numbers,), ((float(number),) for number in range(1, 9)))
        numbers[:] = 7.0
        np.testing.assert_array_equal(next(results), [0.0, 1.0, 2.0])
        results.close()
        in_order(truediv, (numbers,), [(1.0,), (2.0,)])  # never read
        assert list(in_order(add, (1,), [(1,), (2,)])) == [2, 3]


def test_work_that_ends_early_leaves_the_rest_undone_and_other_work_alone(jobs, tmp_path):
    begun = {}
    for index, (share, read, give_up) in enumerate(
        product(WAYS, (0, 1), (close, drop, drop_in_a_circle, fail_between))
    ):
        other, folder = numbers(7), tmp_path / str(index)
        folder.mkdir()
        work = [share(marked, (folder,), [(number,) for number in range(MANY)])]
        for _ in range(read):
            next(work[0])
        give_up(work)
        del work
        begun[folder] = len(list(folder.iterdir()))
        assert next(other) == 7
        assert sorted(numbers(5, share=share)) == list(range(5, 5 + MANY))
        assert list(other) == list(range(8, 7 + MANY))
    for folder, before in begun.items():
        assert len(list(folder.iterdir())) - before <= (2 * jobs if jobs > 1 else 0)


@pytest.mark.usefixtures("jobs")
def test_open_work_may_be_read_by_turns_and_closed_in_any_order():
    for *closed, last in permutations(range(3)):
        work = [numbers(100 * index) for index in range(3)]
        for number in range(4):
            assert [next(results) for results in work] == [number, 100 + number, 200 + number]
        for number, index in enumerate(closed, start=4):
            work[index].close()
            assert next(work[last]) == 100 * last + number
        assert list(work[last]) == list(range(100 * last + 6, 100 * last + MANY))


@pytest.mark.usefixtures("jobs")
def test_work_begun_read_and_given_up_by_chance_gives_what_one_process_gives():
    chance, work = random.Random(1), {}
    for first in range(0, 3000, 10):
        if len(work) < 4:
            refused = first + chance.randrange(12)
            work[first] = in_order(refuse_one, (refused,), [(first + i,) for i in range(8)]), refused, []
        name = chance.choice(list(work))
        results, refused, found = work[name]
        what = chance.random()
        if what > 0.8:
            if what > 0.9:
                results.close()
            work.pop(name)
        elif name + len(found) == refused:
            with pytest.raises(NoPlan, match=f"^{refused} is too narrow"):
                next(results)
            work.pop(name)
        elif len(found) == 8:
            assert next(results, None) is None
            work.pop(name)
        else:
            found.append(next(results))
        assert found == list(range(name, name + len(found)))


@pytest.mark.usefixtures("jobs")
@pytest.mark.parametrize("share", WAYS)
def test_work_may_begin_inside_other_work(share):
    expected = [[number**2 for number in range(count)] for count in range(6)]
    assert sorted(share(squares_below, (), [(count,) for count in range(6)])) == expected
    assert sorted(squares_below(count) for count in numbers(0, 6, share)) == expected


@pytest.mark.usefixtures("jobs")
@pytest.mark.parametrize("share", WAYS)
def test_a_task_that_fails_ends_its_own_work_alone(share):
    other, work = numbers(0), share(refuse_one, (5,), [(number,) for number in range(MANY)])
    found = [next(other)]
    with pytest.raises(NoPlan, match="5 is too narrow"):
        found += work
    assert list(other) == list(range(1, MANY))
    if share is in_order:
        assert found == [0, *range(5)]  # the error comes in its turn


@pytest.mark.parametrize("share", WAYS)
def test_a_process_that_dies_is_one_line_and_work_after_it_goes_on(jobs, share):
    if jobs == 1:
        return  # it would be this one
    idle = numbers(0)
    with pytest.raises(InputError, match="a process ended before its work was done"):
        list(share(die_of, (3,), [(number,) for number in range(MANY)]))
    assert sorted(numbers(0, share=share)) == list(range(MANY))
    try:
        assert list(idle) == list(range(MANY))
    except InputError as error:  # some of its tasks were in the process
        assert "a process ended" in str(error)  # noqa: PT017


@pytest.mark.parametrize("ending", [KeyboardInterrupt(), NoPlan("too narrow")])
def test_no_process_outlives_its_block(tmp_path, ending):
    def ended():
        with local_processes(2):
            work = in_order(marked, (tmp_path,), [(number, 600.0) for number in range(9)])
            wait_for(2, tmp_path)
            work.close()
            raise ending

    with pytest.raises(type(ending)):
        ended()
    assert not living(tmp_path)


@pytest.mark.parametrize("count", [1, 2, pytest.param(3, marks=pytest.mark.thorough)])
def test_ctrl_c_reaches_only_the_process_that_waits(tmp_path, count):
    """A terminal sends it to all processes of its group."""
    code = f"""
import sys
from pathlib import Path
from expdesign.processes import in_order, local_processes
from test_processes_share_work import marked
try:
    with local_processes({count}):
        list(in_order(marked, (Path({str(tmp_path)!r}),), [(number, 600.0) for number in range(9)]))
except KeyboardInterrupt:
    sys.exit(130)
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stderr=subprocess.PIPE, text=True, process_group=0
    ) as process:
        wait_for(count, tmp_path)
        os.killpg(process.pid, signal.SIGINT)
        assert process.communicate(timeout=60.0)[1] == ""
    assert process.returncode == 130
    assert not living(tmp_path)


def hears_ctrl_c(_number):
    time.sleep(0.2)
    return signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_no_process_that_works_for_another_hears_ctrl_c():
    """From its start on: an interruption while it imports a solver aborts it, with pages of traces."""
    code = """
from expdesign.processes import in_order, local_processes
from test_processes_share_work import hears_ctrl_c
with local_processes(3):
    print(set(in_order(hears_ctrl_c, (), [(number,) for number in range(9)])))
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    told = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert told.stdout == "{False}\n"


def test_what_killed_processes_leave_is_removed_without_a_word():
    """Semaphores of a program that ends in the middle of them, which the system keeps until they are removed."""
    code = """
import operator, os
from expdesign.processes import in_order, local_processes
from joblib.externals.loky.backend.synchronize import Lock
with local_processes(2):
    list(in_order(operator.neg, (), [(1,), (2,)]))
lock = Lock()
os._exit(3)
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run([sys.executable, "-c", code], env=environment, stderr=subprocess.PIPE, text=True)
    assert (ended.returncode, ended.stderr) == (3, "")


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_interruption_ends_the_processes_where_waiting_tasks_were_called_off(tmp_path):
    def interrupted():
        with local_processes(2):
            shares = [[(10 * many + one, 600.0) for one in range(4)] for many in range(4)]
            begun = [in_order(marked, (tmp_path,), tasks) for tasks in shares]
            wait_for(2, tmp_path)
            for results in begun:
                results.close()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not living(tmp_path)


def wait_for(count, folder):
    """Until so many tasks have left their mark."""
    until = time.monotonic() + 60.0
    while len(list(folder.iterdir())) < count:
        assert time.monotonic() < until
        time.sleep(0.02)


def living(folder):
    """Those of the processes that left marks."""
    found = set()
    for path in folder.iterdir():
        try:
            os.kill(int(path.name.partition("-")[0]), 0)
            found.add(path.name)
        except ProcessLookupError:
            pass
    return found


@pytest.mark.usefixtures("jobs")
def test_errors_reach_the_caller_as_they_are():
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
    with local_processes(1):
        results = in_order(done.append, (), [(1,), (2,)])
        assert done == []
        next(results)
        assert done == [1]
