"""Files that one logger wrote one after another are one log, whatever their order; others stand beside each other."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.importing import COMPUTER, GNSS, NONE, OWN, Channel, Log, joined
from expdesign.importing.channels import RESTART_GAP_S
from imported_runs import run_import
from instrumented_ship import NAMES, POSE, voyages, write_log
from logged_trial import voyage, write_own


def log(source: str, begin_s: float, clock: str, names: str = "abcde", unit: str = "") -> Log:
    """A minute of readings that tell the file."""
    time_s, values = begin_s + np.arange(60.0), np.full(60, float(source[-1]))
    channels = tuple(Channel(name=name, source=source, unit=unit, time_s=time_s, values=values) for name in names)
    return Log(source=source, clock=clock, channels=channels)


@pytest.mark.parametrize("clock", [GNSS, COMPUTER])
def test_files_are_put_in_the_order_of_their_times(clock: str) -> None:
    (whole,) = joined([log("file 3", 7200.0, clock), log("file 1", 0.0, clock), log("file 2", 60.0, clock)])
    assert whole.source == "file 1"
    assert len(whole.notes) == 1
    for channel in whole.channels:
        assert channel.time_s[::60].tolist() == [0.0, 60.0, 7200.0]
        assert channel.values[::60].tolist() == [1.0, 2.0, 3.0]
        assert (np.diff(channel.time_s) > 0).all()


def test_a_clock_of_its_own_that_begins_anew_goes_on_after_a_gap_and_one_that_does_not_goes_on() -> None:
    (anew,) = joined([log("file 1", 0.0, OWN), log("file 2", 0.0, OWN)])
    assert anew.channels[0].time_s[60] == 59.0 + RESTART_GAP_S
    assert "began anew" in anew.notes[0]
    (on,) = joined([log("file 2", 70.0, OWN), log("file 1", 0.0, OWN)])
    assert on.channels[0].time_s[60] == 70.0
    assert "come after" in on.notes[0]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (log("file 1", 0.0, GNSS), log("file 2", 30.0, GNSS)),  # at once
        (log("file 1", 0.0, GNSS), log("file 2", 60.0, GNSS, "abcxy")),  # other instruments
        (log("file 1", 0.0, GNSS), log("file 2", 60.0, GNSS, unit="kn")),
        (log("file 1", 0.0, GNSS), log("file 2", 60.0, COMPUTER)),
        (log("file 1", 0.0, OWN), log("file 2", 0.0, OWN, "abcd")),
        (log("file 1", 0.0, NONE), log("file 2", 60.0, NONE)),
    ],
)
def test_what_is_no_next_file_of_the_same_logger_stays_apart(one: Log, other: Log) -> None:
    assert joined([one, other]) == [one, other]


def test_beside_another_log_nobody_knows_how_long_the_gap_of_a_clock_that_began_anew_was() -> None:
    logs = [log("file 1", 0.0, OWN), log("file 2", 0.0, OWN), log("other 3", 0.0, GNSS, "xyz")]
    assert joined(logs) == logs
    later = [logs[0], log("file 2", 70.0, OWN), logs[2]]  # the same clock, which runs on
    assert [one.source for one in joined(later)] == ["file 1", "other 3"]


def test_a_file_of_which_the_mapping_speaks_stays_apart() -> None:
    logs = [log("file 1", 0.0, GNSS), log("file 2", 60.0, GNSS)]
    assert joined(logs, apart=["file 1"]) != logs
    assert joined(logs, apart=["file 1", "file 2"]) == logs


def test_a_channel_that_is_in_some_files_alone_is_kept() -> None:
    (whole,) = joined([log("file 1", 0.0, GNSS), log("file 2", 60.0, GNSS, "abcdef")])
    assert {channel.name: len(channel) for channel in whole.channels} == {**dict.fromkeys("abcde", 120), "f": 60}


def dated(path: Path, sailed: dict[str, np.ndarray], names: tuple[str, ...]) -> tuple[str, list[str]]:
    """Header and rows of a log, with times since 1970."""
    header, *rows = write_log(path, sailed, names).read_text(encoding="utf-8").splitlines()
    rows = [f"{1.7e9 + float(row.partition(',')[0]):.1f},{row.partition(',')[2]}" for row in rows]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return header, rows


@pytest.mark.thorough
def test_a_log_in_parts_gives_the_runs_of_the_whole(tmp_path: Path) -> None:
    """Written in parts at any sample; the files of the runs are the same to the last bit."""
    (sailed,) = voyages(1, "zigzag", last_s=240.0, gust=0.3)
    header, rows = dated(tmp_path / "whole.csv", sailed, POSE)
    parts = [tmp_path / f"part{number}.csv" for number in (1, 2, 3)]
    for path, own in zip(parts, (rows[:71], rows[71:150], rows[150:]), strict=True):
        path.write_text("\n".join([header, *own]) + "\n", encoding="utf-8")
    workflows.import_logs([tmp_path / "whole.csv"], tmp_path / "of-whole")
    workflows.import_logs([parts[1], parts[2], parts[0]], tmp_path / "of-parts")
    runs = sorted(path.name for path in (tmp_path / "of-whole").glob("*.csv"))
    assert runs
    assert runs == sorted(path.name for path in (tmp_path / "of-parts").glob("*.csv"))
    for name in runs:
        assert (tmp_path / "of-parts" / name).read_bytes() == (tmp_path / "of-whole" / name).read_bytes()


@pytest.mark.thorough
def test_years_between_two_files_take_no_memory(tmp_path: Path) -> None:
    """Units and answers of actuators are those of each file; no array has a number for each second between."""
    (sailed,) = voyages(1, "zigzag", last_s=240.0, gust=0.3)
    header, rows = dated(tmp_path / "one.csv", sailed, NAMES)
    later = [f"{float(row.partition(',')[0]) + 2e8:.1f},{row.partition(',')[2]}" for row in rows]
    (tmp_path / "two.csv").write_text("\n".join([header, *later]) + "\n", encoding="utf-8")
    said = []
    for logs in (["one.csv"], ["one.csv", "two.csv"]):
        tracemalloc.start()
        workflows.import_logs([tmp_path / name for name in logs], tmp_path / "out")
        said.append(
            (
                json.loads((tmp_path / "out" / "import.json").read_text(encoding="utf-8")),
                tracemalloc.get_traced_memory()[1],
            )
        )
        tracemalloc.stop()
    (one, least), (both, most) = said
    assert most < 2.0 * least  # a number for each second is 1.6 GB
    assert len(both["runs"]) == 2 * len(one["runs"])
    assert [run["what"] for run in both["runs"]] == 2 * [run["what"] for run in one["runs"]]


def test_a_log_of_which_nothing_is_used_is_told(tmp_path: Path) -> None:
    one, other = voyages(2, "zigzag", last_s=240.0, gust=0.3)
    for name, own in (("one.csv", one), ("other.csv", other)):  # two loggers at once
        dated(tmp_path / name, own, NAMES)
    outcome = workflows.import_logs([tmp_path / "one.csv", tmp_path / "other.csv"], tmp_path / "out")
    said = " ".join((tmp_path / "out" / "import.json").read_text(encoding="utf-8").split())
    assert "other.csv: nothing of it is used" in said
    assert any("other.csv: nothing of it is used" in note for note in outcome.document.notes)


def test_what_is_true_of_many_files_is_said_once(tmp_path: Path) -> None:
    trip = voyage(parts=(("zigzag", 40.0),)).every(10)
    paths = [write_own(tmp_path / f"{name}.csv", trip) for name in "abcd"]
    _, said, _ = run_import(*paths)
    notes = said["notes"]
    assert len(set(notes)) == len(notes)
    (joined,) = [note for note in notes if "is read as what comes next" in note]
    assert joined.startswith("a.csv: b.csv and 2 more: ")
    assert sum("time is time_s" in note for note in notes) == 1
    assert not any("too long to be filled" in note for note in notes)  # the gaps between them are ours
