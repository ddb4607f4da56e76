"""Work on the workers of a Dask scheduler is the same work, and what goes wrong there ends in one line."""

import os
import signal
import time
from functools import partial
from pathlib import Path

import cloudpickle
import pytest

from dask_cluster import local_cluster
from expdesign import workflows
from expdesign.cli import main
from expdesign.errors import InputError, NoPlan, UnknownName
from expdesign.processes import as_finished, in_order, on_cluster
from scenario_files import SCENARIOS

pytestmark = pytest.mark.optional
MODEL_SHIP, TRUE = SCENARIOS / "model-ship.toml", SCENARIOS / "vessels" / "tender-20m-true.toml"


@pytest.fixture(scope="module")
def cluster():
    with local_cluster(2) as found:
        yield found


@pytest.fixture(scope="module", autouse=True)
def functions_of_this_file_are_sent():
    cloudpickle.register_pickle_by_value(__import__(__name__))


def doubled(base, number):
    return base + 2 * number


def kill_once(mark, base, number):
    """The first worker that comes here dies of it."""
    if number == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return base + number


def kill(process):
    os.kill(process, signal.SIGKILL)
    time.sleep(600.0)


def interrupt(process):
    os.kill(process, signal.SIGINT)
    time.sleep(600.0)


def marked(folder, number):
    (folder / str(number)).touch()
    time.sleep(0.1)


def refuse(error):
    raise error


def test_results_and_errors_are_those_of_one_process(cluster):
    tasks = [(number,) for number in range(7)]
    with on_cluster(cluster.address):
        assert list(in_order(doubled, (10,), tasks)) == list(in_order_here(10, tasks))
        assert sorted(as_finished(doubled, (10,), tasks)) == sorted(in_order_here(10, tasks))
        with pytest.raises(NoPlan, match="too narrow"):
            list(in_order(refuse, (), [(NoPlan("too narrow"),)]))
        with pytest.raises(UnknownName, match="unknown criterion 'd'"):
            list(in_order(refuse, (), [(UnknownName("criterion", "d", known=("A", "D")),)]))
    assert list(in_order(doubled, (10,), tasks)) == list(in_order_here(10, tasks))  # again in this process


def test_work_that_is_given_up_is_called_off(cluster, tmp_path):
    with on_cluster(cluster.address):
        next(in_order(marked, (tmp_path,), [(number,) for number in range(40)]))
        time.sleep(3.0)
    assert len(list(tmp_path.iterdir())) < 20


def in_order_here(base, tasks):
    return (doubled(base, *task) for task in tasks)


def test_work_of_a_worker_that_dies_is_done_by_another(tmp_path):
    with local_cluster(2) as cluster, on_cluster(cluster.address):
        found = in_order(kill_once, (tmp_path / "died", 10), [(number,) for number in range(20)])
        assert list(found) == list(range(10, 30))
    assert (tmp_path / "died").exists()


def test_work_that_kills_every_worker_is_one_line(tmp_path):
    with local_cluster(2, allowed_failures=0) as cluster, on_cluster(cluster.address):
        results = in_order(kill_once, (tmp_path / "died", 10), [(1,)])
        with pytest.raises(InputError, match="several workers died of the same task"):
            next(results)


def test_a_lost_scheduler_is_one_line():
    with local_cluster(1) as cluster, on_cluster(cluster.address):
        results = in_order(kill, (), [(cluster.scheduler.pid,)])
        with pytest.raises(InputError, match="connection was lost"):
            next(results)


def test_interruptions_end_the_waiting():
    with local_cluster(1) as cluster, pytest.raises(KeyboardInterrupt), on_cluster(cluster.address):
        list(in_order(interrupt, (), [(os.getpid(),)]))


@pytest.mark.parametrize(("text", "version"), [("__version__ = '0.0.1'", "0.0.1"), ("raise ImportError", "none")])
def test_workers_with_another_version_are_refused_in_one_line(tmp_path, capsys, text, version):
    (tmp_path / "other" / "expdesign").mkdir(parents=True)
    (tmp_path / "other" / "expdesign" / "__init__.py").write_text(text, "utf-8")
    with local_cluster(1, first=tmp_path / "other") as cluster:
        call = ["whatif", str(MODEL_SHIP), str(half(tmp_path)), "--out", str(tmp_path / "out"), "--quiet"]
        assert main([*call, "--scheduler", cluster.address]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"has expdesign {version}, expected" in line
    assert not (tmp_path / "out").exists()


def half(folder: Path) -> Path:
    """A variant with half the time."""
    path = folder / "half.toml"
    path.write_text("[design]\ntotal_s = 225.0\n", "utf-8")
    return path


def test_commands_write_the_same_on_a_cluster(cluster, tmp_path):
    whatif = partial(workflows.whatif, MODEL_SHIP, [half(tmp_path)])
    validate = partial(workflows.validate_design, MODEL_SHIP, trials=6, integrator="euler", seed=1)
    for command, file in ((whatif, "whatif.json"), (validate, "validation.json")):
        for place in ({"jobs": 1}, {"scheduler": cluster.address}):
            command(tmp_path / "-".join(place), **place)
        assert (tmp_path / "jobs" / file).read_bytes() == (tmp_path / "scheduler" / file).read_bytes()


def test_a_scheduler_lost_between_two_cases_leaves_no_files(tmp_path):
    with local_cluster(1) as cluster:

        def progress(activity, share):
            if "is done" in activity:
                cluster.scheduler.kill()

        with pytest.raises(InputError, match=f"--scheduler {cluster.address}: the connection was lost"):
            workflows.whatif(
                MODEL_SHIP, [half(tmp_path)], tmp_path / "out", scheduler=cluster.address, progress=progress
            )
    assert not (tmp_path / "out").exists()


def test_no_scheduler_is_one_line(tmp_path):
    with pytest.raises(InputError, match="no scheduler answers there"):
        workflows.whatif(MODEL_SHIP, [half(tmp_path)], tmp_path, scheduler="tcp://127.0.0.1:9")
