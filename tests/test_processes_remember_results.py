"""What is repeated is read: same files, no work twice, and never a result of other values or programs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import shapely

from counted_work import counted_work
from design_case import duration_problem
from expdesign import memory, workflows
from expdesign.durations import solve_durations
from expdesign.memory import ABSENT, VARIABLE, Memory, digest, in_order, recalled, remembering, user_memory
from expdesign.processes import local_processes
from nomoto_ship import nomoto_ship
from short_examples import example_run, example_work

CALLS: list[object] = []


def doubled(value):
    CALLS.append(value)
    return 2 * value


@pytest.fixture(autouse=True)
def _no_calls():
    CALLS.clear()


def entries(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if not path.name.startswith(".")]


@pytest.fixture(scope="module")
def repeated(made_once, tmp_path_factory):
    """A short scenario, folders of its run with an empty memory and with what that left, and work of the second."""
    cold, _ = example_run(made_once, "model-ship")
    scenario = cold.with_name(f"{cold.name}-scenario") / "scenarios" / "model-ship.toml"
    warm = tmp_path_factory.mktemp("repeated") / "warm"
    with pytest.MonkeyPatch.context() as patch, counted_work() as (counts, progress):
        patch.setenv(VARIABLE, str(cold.with_name(f"{cold.name}-cache")))
        workflows.run(scenario, warm, seed=1, progress=progress)
    return scenario, cold, warm, counts


def test_files_are_the_same_with_a_cold_and_a_warm_cache(repeated):
    _, cold, warm, _ = repeated
    files = {path.name: path.read_bytes() for path in cold.iterdir()}
    assert {path.name: path.read_bytes() for path in warm.iterdir()} == files


def test_durations_are_the_same_without_a_cache(repeated, tmp_path):
    scenario, cold, *_ = repeated
    workflows.durations(scenario, tmp_path, jobs=1, seed=1)
    here, there = (json.loads((folder / "durations.json").read_text("utf-8")) for folder in (tmp_path, cold))
    for found in (here, there):
        assert found["solver"].pop("wall_s") > 0
    assert here == there


def test_a_second_run_solves_nothing_and_sails_no_drawn_trials(made_once, repeated):
    *_, work = repeated
    done = {kind for phase, counts in work.items() if phase != "files" for kind in counts}
    assert sum(counts.get("solves", 0) for counts in example_work(made_once, "model-ship").values()) > 0
    assert not done & {"solves", "iterations", "steps of many ships"}


def test_a_result_is_computed_once_for_the_same_values(tmp_path):
    with remembering(Memory(tmp_path)):
        assert [recalled(doubled, np.arange(3.0))[2] for _ in range(3)] == [4.0, 4.0, 4.0]
        assert list(in_order(doubled, (), [(1,), (2,), (1.0,)])) == [2, 4, 2.0]
        assert list(in_order(doubled, (), [(2,), (5,)])) == [4, 10]
    assert len(CALLS) == 1 + 3 + 1
    recalled(doubled, 1)
    with remembering(None):
        recalled(doubled, 1)
    assert len(CALLS) == 7


def test_what_has_no_digest_is_computed_each_time(tmp_path):
    with remembering(Memory(tmp_path)):
        for _ in range(2):
            with pytest.raises(TypeError):
                recalled(doubled, object())
    assert len(CALLS) == 2
    assert not entries(tmp_path)


def test_errors_are_not_remembered(tmp_path):
    with remembering(Memory(tmp_path)):
        for _ in range(2):
            with pytest.raises(TypeError):
                recalled(doubled, None)
    assert len(CALLS) == 2


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: path.write_bytes(path.read_bytes()[:-1]),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(path.read_bytes()[:-1] + b"X"),
        lambda path: path.chmod(0o666),
        lambda path: (path.unlink(), path.mkdir()),
        lambda path: (path.rename(path.parent / "real"), path.symlink_to(path.parent / "real")),
    ],
    ids=["cut", "empty", "changed", "others may write", "folder", "link"],
)
def test_a_damaged_or_foreign_entry_counts_as_absent(tmp_path, damage):
    with remembering(Memory(tmp_path)):
        assert recalled(doubled, 21) == 42
        damage(*entries(tmp_path))
        assert recalled(doubled, 21) == 42
    assert CALLS == [21, 21]


def test_an_entry_under_another_key_counts_as_absent(tmp_path):
    kept = Memory(tmp_path)
    kept.write("a", 1)
    (tmp_path / "a").rename(tmp_path / "b")
    assert kept.read("b") is ABSENT


def test_a_folder_of_other_writers_is_neither_read_nor_written(tmp_path):
    kept = Memory(tmp_path)
    kept.write("a", 1)
    tmp_path.chmod(0o777)
    kept.write("b", 1)
    assert kept.read("a") is ABSENT
    assert [path.name for path in entries(tmp_path)] == ["a"]


def test_other_values_and_other_programs_are_never_answered(tmp_path, monkeypatch):
    vessel = nomoto_ship()
    longer = replace(vessel, length_m=vessel.length_m * (1 + 1e-15))
    faster = replace(vessel, model=replace(vessel.model, parameters=vessel.model.parameters * (1 + 1e-15)))
    assert len({digest(ship) for ship in (vessel, longer, faster)}) == 3
    assert digest(replace(vessel)) == digest(vessel)
    with remembering(Memory(tmp_path)):
        recalled(doubled, 1)
        monkeypatch.setattr(memory, "programs", lambda: "of another version")
        recalled(doubled, 1)
    assert len(CALLS) == 2


def test_the_digest_of_programs_follows_every_source_file(tmp_path, monkeypatch):
    package = tmp_path / "expdesign"
    (package / "room").mkdir(parents=True)
    (package / "room" / "rule.py").write_text("LIMIT = 1\n")
    monkeypatch.setattr(memory, "__file__", str(package / "memory.py"))
    found = set()
    for change in (
        lambda: None,
        lambda: (package / "room" / "rule.py").write_text("LIMIT = 2\n"),
        lambda: (package / "room" / "rule.py").rename(package / "rule.py"),
        lambda: monkeypatch.setattr(memory, "version", lambda name: "0.0"),
    ):
        change()
        found.add(memory.programs.__wrapped__())
    assert len(found) == 4


def test_no_two_values_look_alike():
    square = shapely.box(0, 0, 1, 1)
    values = [
        *(None, True, 1, 1.0, -0.0, 0.0, "1", b"1", np.float32(1), np.ones(1), np.ones((1, 1)), np.ones(1, dtype=int)),
        *((1,), [1], (1, ()), ((1,),), ("ab", "c"), ("a", "bc"), {"a": 1}, {"a": "1"}, {1}, Path("1")),
        *(square, shapely.box(0, 0, 1, 2), doubled, partial(doubled, 1), partial(doubled, value=1), int, entries),
        *(np.random.default_rng(seed) for seed in (1, 2)),
    ]
    assert len({digest(value) for value in values}) == len(values)
    assert digest(1, 2) != digest((1, 2))


def test_the_folder_keeps_its_size_and_what_was_used_last(tmp_path):
    kept = Memory(tmp_path, most_bytes=5000)
    with remembering(kept):
        for number in range(10):
            recalled(doubled, bytes([number]) * 400)
            for age, path in enumerate(sorted(entries(tmp_path), key=lambda path: -path.stat().st_mtime_ns)):
                os.utime(path, ns=(0, 10**15 - age * 10**9))
        recalled(doubled, bytes(400))  # used again
        assert sum(path.stat().st_size for path in entries(tmp_path)) > kept.most_bytes
    assert 0.7 * kept.most_bytes < sum(path.stat().st_size for path in entries(tmp_path)) <= kept.most_bytes
    CALLS.clear()
    with remembering(kept):
        for number in (0, 9, 1):
            recalled(doubled, bytes([number]) * 400)
    assert [bytes([1]) * 400] == CALLS


def test_a_folder_s_other_files_are_left_alone(tmp_path):
    mine = tmp_path / "thesis.pdf"
    mine.write_bytes(bytes(10_000))
    os.utime(mine, ns=(0, 0))
    with remembering(Memory(tmp_path, most_bytes=100)):
        recalled(doubled, bytes(400))
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.pdf"]


def test_several_writers_at_once_leave_whole_entries(tmp_path):
    kept = Memory(tmp_path)

    def work(worker):
        for turn in range(40):
            kept.write(str(turn % 4), np.full(20_000, float(worker)))
            found = kept.read(str((turn + worker) % 4))
            assert found is ABSENT or (found == found[0]).all()

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))
    assert {path.name for path in tmp_path.iterdir()} == {"0", "1", "2", "3"}


def test_two_processes_at_once_agree_and_share(tmp_path):
    code = (
        "from operator import mul\nfrom pathlib import Path\nfrom expdesign.memory import *\n"
        f"with remembering(Memory(Path({str(tmp_path)!r}))):\n"
        "    print([recalled(mul, number, 'ab') for number in range(60)] == ['ab' * number for number in range(60)])\n"
    )
    both = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate()[0].strip() for process in both] == ["True", "True"]
    assert len(entries(tmp_path)) == 60


def test_processes_work_only_on_what_is_not_remembered(tmp_path):
    with remembering(Memory(tmp_path)), local_processes(2):
        assert list(in_order(pow, (2,), [(3,), (4,)])) == [8, 16]
        assert list(in_order(pow, (2,), [(4,), (5,), (3,)])) == [16, 32, 8]
    assert len(entries(tmp_path)) == 3


def test_the_environment_chooses_the_folder_or_none(tmp_path, monkeypatch):
    for word in ("off", "OFF", "0"):
        monkeypatch.setenv(VARIABLE, word)
        assert user_memory() is None
    monkeypatch.setenv(VARIABLE, str(tmp_path / "here"))
    assert user_memory().folder == tmp_path / "here"
    monkeypatch.delenv(VARIABLE)
    if sys.platform == "linux":
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        assert user_memory().folder == tmp_path / "expdesign"
        monkeypatch.setenv("XDG_CACHE_HOME", "relative")
        assert user_memory().folder == Path.home() / ".cache" / "expdesign"


def test_a_folder_that_cannot_be_made_does_no_harm(tmp_path):
    (tmp_path / "file").write_text("")
    with remembering(Memory(tmp_path / "file" / "cache")):
        assert recalled(doubled, 1) == 2


def test_how_long_a_solver_took_does_not_count_in_the_digest_of_what_it_found():
    design = solve_durations(duration_problem(np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])))
    assert design.solver is not None
    slower = replace(design, solver=replace(design.solver, wall_s=design.solver.wall_s + 1.0))
    assert digest(slower) == digest(design)
    assert digest(replace(design, gap=design.gap + 1.0)) != digest(design)
