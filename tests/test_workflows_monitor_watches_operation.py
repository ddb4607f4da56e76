"""`expdesign monitor`: voyages of a simulated tender, with and without a change, whole, in parts and as a stream."""

from __future__ import annotations

import io
import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.monitoring import TOLD_APART, stretch_length
from expdesign.scenario import load_vessel
from expdesign.vessel import Vessel
from monitoring_case import ROOT, TENDER, tender, voyage_csv

pytestmark = pytest.mark.usefixtures("undrawn")

HOUR = 3600


@pytest.fixture(scope="module")
def voyages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("voyages")
    return {
        "reference": voyage_csv(folder / "reference.csv", tender(), 3 * HOUR // 2, seed=1),
        "same": voyage_csv(folder / "same.csv", tender(), HOUR, seed=2),
        "changed": voyage_csv(folder / "changed.csv", tender(N_r=1.2), 3 * HOUR // 4, seed=3, begin_s=float(HOUR)),
    }


def told_in(folder: Path) -> dict[str, object]:
    content: dict[str, object] = json.loads((folder / "monitor.json").read_text())
    return content


def monitored(folder: Path, *words: object) -> dict[str, object]:
    assert main(["monitor", *map(str, words), "--vessel", str(TENDER), "--out", str(folder), "--quiet"]) == 0
    return told_in(folder)


def rewritten(source: Path, target: Path, column: str, cell: Callable[[int, str], str]) -> Path:
    """A log with other cells in a column, by the number of the row and what stands there."""
    header, *rows = source.read_text().splitlines()
    place, table = header.split(",").index(column), [row.split(",") for row in rows]
    for number, row in enumerate(table):
        row[place] = cell(number, row[place])
    target.write_text("\n".join([header, *map(",".join, table)]) + "\n")
    return target


def ten_digits(content: object) -> object:
    """Sums over stretches depend on which are simulated together, in their last digits."""
    return json.loads(json.dumps(content), parse_float=lambda text: f"{float(text):.10g}")


@pytest.mark.thorough
def test_a_change_of_the_ship_is_told_and_nothing_else(voyages: dict[str, Path], tmp_path: Path) -> None:
    told = monitored(tmp_path, voyages["same"], voyages["changed"], "--reference", voyages["reference"])
    assert told["judged_h"] == pytest.approx(1.75, abs=0.05)
    (alarm,) = told["alarms"]
    assert alarm["effect"] == "theta:N_r"
    assert HOUR - 300 <= alarm["since_s"] <= alarm["time_s"] <= HOUR + 1800
    size = 0.2 * -0.15
    assert alarm["value"] == pytest.approx(size, abs=5 * alarm["std"])
    rows = (tmp_path / "since-change.csv").read_text().splitlines()
    assert float(rows[1].split(",")[0]) >= alarm["since_s"]
    page = (tmp_path / "monitor.html").read_text()
    assert "parameter N_r" in page
    saved = json.loads((tmp_path / "monitor-state.json").read_text())
    assert len(saved["phase"]["moments"]) >= 1.75 * 6  # of the figures: a watch of an hour is a line, not a point
    assert "http" not in page.replace("http://www.w3.org", "")


@pytest.fixture(scope="module")
def watched(voyages: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a watch over the voyage of the same ship."""
    folder = tmp_path_factory.mktemp("watched")
    (folder / "since-change.csv").write_text("of an earlier watch\n")  # no alarm stands for it
    monitored(folder, voyages["same"], "--reference", voyages["reference"])
    return folder


@pytest.fixture
def no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("expdesign.workflows.commands.monitor.document_html", lambda document: "")


def without_page(test: Callable[..., None]) -> Callable[..., None]:
    """A thorough test that looks at no page: drawing it takes longer than an hour's watch."""
    return pytest.mark.thorough(pytest.mark.usefixtures("no_page")(test))


@pytest.mark.thorough
def test_a_ship_as_in_the_reference_raises_no_alarm(watched: Path) -> None:
    told = told_in(watched)
    assert told["alarms"] == []
    assert "No alarm" in told["verdict"][0]
    assert not (watched / "since-change.csv").exists()


def test_turns_tell_yaw_sooner_than_a_steady_course_and_the_budget_counts_every_stretch(watched: Path) -> None:
    told = told_in(watched)
    budget = {entry["kind"]: entry for entry in told["budget"]}
    assert sum(entry["compared_h"] for entry in budget.values()) == pytest.approx(told["judged_h"])
    steady, turning = budget["steady course"], budget["turning"]
    for effect in ("theta:N_r", "theta:N_mu", "inertia:r", "gyro"):
        assert turning["alarm_after_s"][effect] < steady["alarm_after_s"][effect]
    damping = [entry["mean_accelerations"]["theta:N_r"]["yaw"] for entry in (steady, turning)]
    assert damping[1] > 3.0 * damping[0]
    delays = [change["expected_delay_s"] for change in told["changes"] if change["expected_delay_s"] is not None]
    by_kind = [delay for entry in told["budget"] for delay in entry["alarm_after_s"].values() if delay is not None]
    assert min(delays + by_kind) >= TOLD_APART[0] * stretch_length(load_vessel(TENDER).length_m)
    thrust = steady["mean_accelerations"]
    assert thrust["gain"]["surge"] == pytest.approx(thrust["theta:X_mu"]["surge"])  # its one term of the actuators
    assert "Which manoeuvres reveal which change" in (watched / "monitor.html").read_text()


@without_page
def test_a_watch_that_is_resumed_loses_nothing_and_counts_nothing_twice(
    voyages: dict[str, Path], watched: Path, tmp_path: Path
) -> None:
    header, *rows = voyages["same"].read_text().splitlines(keepends=True)
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    first.write_text(header + "".join(rows[:1666]))  # ends within a stretch
    second.write_text(header + "".join(rows[1666:]))
    whole = told_in(watched)
    monitored(tmp_path / "parts", first, "--reference", voyages["reference"])
    parts = monitored(tmp_path / "parts", second, "--resume")
    assert ten_digits({**parts, "history": [], "notes": []}) == ten_digits({**whole, "history": [], "notes": []})
    states = [json.loads((folder / "monitor-state.json").read_text()) for folder in (watched, tmp_path / "parts")]
    assert agree(states[0]["phase"]["state"], states[1]["phase"]["state"])
    assert states[0]["reading"]["pending"] == states[1]["reading"]["pending"]


def agree(one: object, other: object) -> bool:
    """Whether two states are the same but for rounding of sums over arrays of another length."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(agree(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(agree, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return one == pytest.approx(other, rel=1e-6, abs=1e-6)
    return one == other


class Dying(io.StringIO):
    """A stream whose reader is ended after some lines."""

    left = 0

    def readline(self, size: int | None = -1) -> str:
        if self.left == 0:
            raise KeyboardInterrupt
        self.left -= 1
        return super().readline(size)


def streamed(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch, *words: object, lines: int = -1) -> int:
    """The status of a watch over a stream that ends by itself, or after some lines by force."""
    stream = Dying(text)
    stream.left = lines
    monkeypatch.setattr("sys.stdin", stream)
    return main(["monitor", "-", *map(str, words), "--vessel", str(TENDER), "--out", str(folder), "--quiet"])


@without_page
@pytest.mark.parametrize("lines", [1999])
@pytest.mark.parametrize("learning", [False, True])
def test_a_watch_that_is_ended_by_force_goes_on_as_if_it_had_not_been(
    voyages: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: int, learning: bool
) -> None:
    text = voyages["changed" if not learning else "reference"].read_text()
    begin = ["--learn-h", 0.7] if learning else ["--reference", voyages["reference"]]
    assert streamed(text, tmp_path / "whole", monkeypatch, *begin, "--every-s", 600) == 0
    assert streamed(text, tmp_path / "parts", monkeypatch, *begin, "--every-s", 600, lines=lines) == 130
    rest = ["--resume", "--every-s", 600, *(["--learn-h", 0.7] if learning else [])]
    assert streamed(text, tmp_path / "parts", monkeypatch, *rest) == 0
    states = [json.loads((tmp_path / name / "monitor-state.json").read_text()) for name in ("whole", "parts")]
    assert states[0]["phase"] == states[1]["phase"]
    for key in ("now_s", "pending", "left_out_rows"):
        assert states[0]["reading"][key] == states[1]["reading"][key]


@pytest.mark.slow
def test_a_killed_watch_leaves_a_state_to_go_on_from(voyages: dict[str, Path], tmp_path: Path) -> None:
    words = [sys.executable, "-m", "expdesign", "monitor", "-", "--vessel", str(TENDER), "--quiet"]
    begin = ["--reference", str(voyages["reference"]), "--every-s", "600"]
    text = voyages["same"].read_text()
    with subprocess.Popen([*words, *begin, "--out", str(tmp_path)], stdin=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        process.stdin.write(text[: len(text) // 2])
        process.stdin.flush()
        state = tmp_path / "monitor-state.json"
        while process.poll() is None and not state.exists():
            time.sleep(0.05)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert monitored(tmp_path, voyages["same"], "--resume")["judged_h"] > 1.0


@without_page
def test_a_file_that_grows_is_read_on_from_where_it_ended(
    voyages: dict[str, Path], watched: Path, tmp_path: Path
) -> None:
    lines, path = voyages["same"].read_text().splitlines(keepends=True), tmp_path / "log.csv"
    whole = told_in(watched)
    path.write_text("".join(lines[:1000]) + lines[1000][:20])  # a row is being written
    monitored(tmp_path / "parts", path, "--reference", voyages["reference"])
    path.write_text("".join(lines))
    parts, again = (monitored(tmp_path / "parts", path, "--resume") for _ in range(2))
    assert parts["judged_h"] == whole["judged_h"] == again["judged_h"]
    assert "log.csv: its first 999 rows had been watched before" in parts["notes"]
    assert "log.csv: its first 3600 rows had been watched before" in again["notes"]


@without_page
def test_results_do_not_depend_on_the_number_of_processes(
    voyages: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("expdesign.processes.sharing.ALONE_S", 0.0)
    monkeypatch.setattr("expdesign.workflows.commands.monitor.MOST_ROWS", 1200)
    words = [voyages["changed"], "--reference", voyages["reference"]]
    table = [monitored(tmp_path / f"{jobs}", *words, "--jobs", jobs) for jobs in (1, 2)]
    assert table[0] == table[1]


@without_page
def test_notes_on_a_part_of_a_file_say_of_which_rows(
    voyages: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("expdesign.workflows.commands.monitor.MOST_ROWS", 1200)
    header, *rows = voyages["same"].read_text().splitlines()
    order, gyro = (header.split(",").index(name) for name in ("n1_rps", "r_radps"))
    table = np.array([row.split(",") for row in rows], dtype=object)
    assert len(set(table[:, order])) > 1
    table[2400:, order], table[2400:, gyro] = table[2400, order], table[2400, gyro]  # in the last piece
    log = tmp_path / "log.csv"
    log.write_text("\n".join([header, *map(",".join, table)]) + "\n")
    notes = monitored(tmp_path / "out", log, "--reference", voyages["reference"])["notes"]
    assert not any("cannot be estimated" in note for note in notes)  # orders are kept for a while, no loss
    (dead,) = (note for note in notes if "dead sensor" in note)
    assert dead.startswith("log.csv, rows 2402 to 3601: r_radps is ")
    assert not any(note.startswith("log.csv: ") and "in all rows" in note for note in notes)


@without_page
def test_a_stream_is_watched_as_its_file_is(
    voyages: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = monitored(tmp_path / "file", voyages["changed"], "--reference", voyages["reference"])
    monkeypatch.setattr("sys.stdin", io.StringIO(voyages["changed"].read_text()))
    stream = monitored(tmp_path / "stream", "-", "--reference", voyages["reference"], "--every-s", 600)
    assert [alarm["effect"] for alarm in stream["alarms"]] == [alarm["effect"] for alarm in whole["alarms"]]
    assert stream["judged_h"] == whole["judged_h"]


@pytest.mark.thorough
def test_the_example_of_the_readme_finds_the_change(
    voyages: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (line,) = re.findall(r"bin/expdesign (monitor .*)", (ROOT / "README.md").read_text())
    for name, path in (
        ("voyage.csv", voyages["changed"]),
        ("known.csv", voyages["reference"]),
        ("ship.toml", TENDER),
    ):
        (tmp_path / name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    assert main(line.split()) == 0
    (alarm,) = json.loads((tmp_path / "runs" / "voyage" / "monitor.json").read_text())["alarms"]
    assert alarm["effect"] == "theta:N_r"


@without_page
def test_gaps_and_rows_without_numbers_are_left_out(voyages: dict[str, Path], tmp_path: Path) -> None:
    none = {100: "", 101: "NaN", 2500: "NaN"}
    path = rewritten(voyages["same"], tmp_path / "gaps.csv", "u_mps", lambda number, cell: none.get(number, cell))
    header, *rows = path.read_text().splitlines(keepends=True)
    path.write_text(header + "".join(rows[:1500] + rows[2100:]))
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    assert told["rows_without_numbers"] == 3
    assert told["judged_h"] == pytest.approx(1.0 - 603 / HOUR, abs=0.06)
    assert told["alarms"] == []


@without_page
def test_no_more_hours_are_judged_than_there_are(voyages: dict[str, Path], tmp_path: Path) -> None:
    header, *rows = voyages["same"].read_text().splitlines(keepends=True)
    kept = [row for number, row in enumerate(rows) if number % 45 > 2]  # a gap within every stretch
    path = tmp_path / "gaps.csv"
    path.write_text(header + "".join(kept))
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    judged_h = told["judged_h"] + told["not_judged_h"]
    assert 0.9 * len(kept) / HOUR < judged_h <= len(kept) / HOUR
    assert sum(entry["compared_h"] for entry in told["budget"]) <= judged_h + 1e-9
    assert told["history"][-1]["time_s"] <= len(rows)


@without_page
def test_a_stream_resumed_from_its_own_log_judges_nothing_twice(
    voyages: dict[str, Path], watched: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    header, *rows = voyages["same"].read_text().splitlines(keepends=True)
    monkeypatch.setattr("sys.stdin", io.StringIO(header + "".join(rows[:2000])))
    monitored(tmp_path, "-", "--reference", voyages["reference"])
    told = [monitored(tmp_path, voyages["same"], "--resume")]
    monkeypatch.setattr("sys.stdin", io.StringIO(header + "".join(rows)))
    told.append(monitored(tmp_path, "-", "--resume"))
    for one in told:
        assert one["judged_h"] == pytest.approx(told_in(watched)["judged_h"])
        assert one["history"][-1]["time_s"] <= HOUR


@without_page
def test_times_are_those_of_the_datas_clock(voyages: dict[str, Path], tmp_path: Path) -> None:
    begin_s, source = 1714564800, voyages["changed"]
    path = rewritten(source, tmp_path / "dated.csv", "time_s", lambda _, cell: f"{float(cell) + begin_s - HOUR:.1f}")
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    (alarm,) = told["alarms"]
    assert begin_s <= alarm["since_s"] < alarm["time_s"] <= begin_s + 3 * HOUR // 4
    assert any("Since 2024-05-01 12:" in sentence for sentence in told["verdict"])


@pytest.mark.parametrize("option", ["--size", "--false-alarm-days"])
def test_a_watch_goes_on_with_the_options_it_was_begun_with(
    voyages: dict[str, Path], watched: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    (tmp_path / "monitor-state.json").write_bytes((watched / "monitor-state.json").read_bytes())
    words = [str(voyages["same"]), "--vessel", str(TENDER), "--out", str(tmp_path), "--resume", option, "0.3"]
    assert main(["monitor", *words]) == 2
    assert f"{option} is 0.3, but the watch was begun with" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "status", "what"),
    [
        (["{same}", "--learn-h", "0"], 2, "--learn-h is 0"),
        (["{same}", "--size", "2"], 2, "--size is 2"),
        (["{same}", "-", "--reference", "{reference}"], 2, "- stands beside other data files"),
        (["{same}", "--resume"], 2, "monitor-state.json: does not exist"),
        (["{same}", "--resume", "--reference", "{reference}"], 2, "expected one"),
        (["{same}"], 3, "give files of a reference"),
        (["{same}", "--learn-h", "0.2"], 3, "expected at least"),
        (["nothing.csv", "--reference", "{reference}"], 2, "nothing.csv: does not exist, expected a CSV file"),
    ],
)
def test_what_cannot_be_watched_is_refused_in_one_line(
    voyages: dict[str, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    status: int,
    what: str,
) -> None:
    spelled = [word.format(**voyages) for word in words]
    assert main(["monitor", *spelled, "--vessel", str(TENDER), "--out", str(tmp_path / "out"), "--quiet"]) == status
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert what in told[0]
    assert not (tmp_path / "out").exists()


def test_the_state_of_another_program_is_refused(voyages: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "monitor-state.json").write_text("{}")
    words = [str(voyages["same"]), "--vessel", str(TENDER), "--out", str(tmp_path), "--resume"]
    assert main(["monitor", *words, "-q"]) == 2


@pytest.mark.thorough
def test_the_reference_may_be_the_beginning_of_the_data(voyages: dict[str, Path], tmp_path: Path) -> None:
    told = monitored(tmp_path / "out", voyages["reference"], "--learn-h", 1.1)
    assert 1.1 * HOUR <= told["reference"]["until_s"] <= 1.1 * HOUR + 60
    assert told["judged_h"] == pytest.approx(0.4, abs=0.05)


@without_page
def test_files_whose_times_begin_again_follow_each_other(voyages: dict[str, Path], tmp_path: Path) -> None:
    told = monitored(tmp_path, voyages["same"], voyages["reference"], "--reference", voyages["reference"])
    assert told["judged_h"] == pytest.approx(2.5, abs=0.05)
    assert told["alarms"] == []
    assert told["history"][-1]["time_s"] > 3.4 * HOUR


@without_page
def test_a_loss_of_half_the_thrust_is_a_change_and_not_left_out(voyages: dict[str, Path], tmp_path: Path) -> None:
    path = voyage_csv(tmp_path / "half.csv", tender(X_mu=0.5, Y_mu=0.5, N_mu=0.5), HOUR // 2, seed=9)
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    alarm = told["alarms"][0]
    assert alarm["effect"] == "gain"
    assert alarm["value"] == pytest.approx(-0.5, abs=max(5 * alarm["std"], 0.02))


@without_page
def test_data_unlike_the_reference_are_not_called_the_same_ship(voyages: dict[str, Path], tmp_path: Path) -> None:
    rng = np.random.default_rng(1)

    def noisy(_: int, cell: str) -> str:
        return f"{float(cell) + 0.2 * rng.standard_normal():.6g}"

    path = rewritten(voyages["same"], tmp_path / "noisy.csv", "v_mps", noisy)
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    assert told["not_judged_h"] > 0.9
    assert told["alarms"] == []
    assert "is not known" in told["verdict"][0]
    assert not any("No alarm" in sentence for sentence in told["verdict"])


def heavier(factor: float) -> Vessel:
    """The tender with more inertia and in proportion less acceleration by every term."""
    names = load_vessel(TENDER).model.names
    return tender(**{name: 1.0 / factor for name in names if name not in ("X_vr", "Y_ur")})


@without_page
def test_another_load_after_a_port_call_is_a_remark_and_no_alarm(voyages: dict[str, Path], tmp_path: Path) -> None:
    loaded = voyage_csv(tmp_path / "loaded.csv", heavier(1.15), HOUR, seed=7, begin_s=9.0 * HOUR)
    both = [voyages["same"], loaded, "--reference", voyages["reference"]]
    told = monitored(tmp_path / "ports", *both)
    assert told["alarms"] == []
    (call,) = told["port_calls"]
    assert (call["from_s"], call["until_s"]) == (pytest.approx(HOUR, abs=60), pytest.approx(9 * HOUR, abs=60))
    surge = call["load"]["inertia:u"]
    assert surge["value"] == pytest.approx(0.15, abs=3 * surge["std"])
    assert any("another load" in sentence for sentence in told["verdict"])
    assert monitored(tmp_path / "none", *both, "--port-h", "inf")["alarms"]


@without_page
@pytest.mark.parametrize("correction_s", [-2.0, -0.4, 0.4])
def test_a_small_correction_of_the_clock_is_survived(
    voyages: dict[str, Path], watched: Path, tmp_path: Path, correction_s: float
) -> None:
    def corrected(number: int, cell: str) -> str:
        return cell if number < 1800 else f"{float(cell) + correction_s:.1f}"

    path = rewritten(voyages["same"], tmp_path / "corrected.csv", "time_s", corrected)
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    assert told["judged_h"] == pytest.approx(told_in(watched)["judged_h"])
    assert told["alarms"] == []
    assert told["port_calls"] == []
    assert told["history"][-1]["time_s"] == pytest.approx(HOUR, abs=5.0)
