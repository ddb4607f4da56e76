"""`expdesign monitor`: voyages of a simulated tender, with and without a change, whole, in parts and as a stream."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from monitoring_case import TENDER, tender, voyage_csv

HOUR = 3600


@pytest.fixture(scope="module")
def voyages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("voyages")
    return {
        "reference": voyage_csv(folder / "reference.csv", tender(), 3 * HOUR // 2, seed=1),
        "same": voyage_csv(folder / "same.csv", tender(), HOUR, seed=2),
        "changed": voyage_csv(folder / "changed.csv", tender(N_r=1.2), 3 * HOUR // 4, seed=3, begin_s=float(HOUR)),
    }


def monitored(folder: Path, *words: object) -> dict[str, object]:
    assert main(["monitor", *map(str, words), "--vessel", str(TENDER), "--out", str(folder), "--quiet"]) == 0
    content: dict[str, object] = json.loads((folder / "monitor.json").read_text())
    return content


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
    assert "http" not in page.replace("http://www.w3.org", "")


def test_a_ship_as_in_the_reference_raises_no_alarm(voyages: dict[str, Path], tmp_path: Path) -> None:
    told = monitored(tmp_path, voyages["same"], "--reference", voyages["reference"])
    assert told["alarms"] == []
    assert "No alarm" in told["verdict"][0]
    assert not (tmp_path / "since-change.csv").exists()


def test_a_watch_that_is_resumed_loses_nothing_and_counts_nothing_twice(
    voyages: dict[str, Path], tmp_path: Path
) -> None:
    header, *rows = voyages["same"].read_text().splitlines(keepends=True)
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    first.write_text(header + "".join(rows[:1666]))  # ends within a stretch
    second.write_text(header + "".join(rows[1666:]))
    whole = monitored(tmp_path / "whole", voyages["same"], "--reference", voyages["reference"])
    monitored(tmp_path / "parts", first, "--reference", voyages["reference"])
    parts = monitored(tmp_path / "parts", second, "--resume")
    for key in ("judged_h", "not_judged_h", "alarms", "threshold"):
        assert parts[key] == whole[key]
    states = [json.loads((tmp_path / name / "monitor-state.json").read_text()) for name in ("whole", "parts")]
    scores, known = (
        [np.array(state["state"]["whole"][key][0]) for state in states] for key in ("score", "information")
    )
    chance = np.sqrt(np.diag(known[0]))  # rates of headings lack a sample where pieces meet
    assert np.all(np.abs(scores[0] - scores[1]) <= 0.1 * chance + 1e-9)
    assert states[0]["pending"] == states[1]["pending"]


def test_a_stream_is_watched_as_its_file_is(
    voyages: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = monitored(tmp_path / "file", voyages["changed"], "--reference", voyages["reference"])
    monkeypatch.setattr("sys.stdin", io.StringIO(voyages["changed"].read_text()))
    stream = monitored(tmp_path / "stream", "-", "--reference", voyages["reference"], "--every-s", 600)
    assert [alarm["effect"] for alarm in stream["alarms"]] == [alarm["effect"] for alarm in whole["alarms"]]
    assert stream["judged_h"] == whole["judged_h"]


def test_gaps_and_rows_without_numbers_are_left_out(voyages: dict[str, Path], tmp_path: Path) -> None:
    header, *rows = voyages["same"].read_text().splitlines(keepends=True)
    names = header.strip().split(",")
    for index in (100, 101, 2500):
        cells = rows[index].strip().split(",")
        cells[names.index("u_mps")] = "" if index == 100 else "NaN"
        rows[index] = ",".join(cells) + "\n"
    path = tmp_path / "gaps.csv"
    path.write_text(header + "".join(rows[:1500] + rows[2100:]))
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    assert told["rows_without_numbers"] == 3
    assert told["judged_h"] == pytest.approx(1.0 - 603 / HOUR, abs=0.06)
    assert told["alarms"] == []


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
        (["nothing.csv", "--reference", "{reference}"], 2, "cannot be read"),
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
    assert (
        main(["monitor", str(voyages["same"]), "--vessel", str(TENDER), "--out", str(tmp_path), "--resume", "-q"]) == 2
    )


def test_the_reference_may_be_the_beginning_of_the_data(voyages: dict[str, Path], tmp_path: Path) -> None:
    told = monitored(tmp_path / "out", voyages["reference"], "--learn-h", 1.1)
    assert 1.1 * HOUR <= told["reference"]["until_s"] <= 1.1 * HOUR + 60
    assert told["judged_h"] == pytest.approx(0.4, abs=0.05)


def test_files_whose_times_begin_again_follow_each_other(voyages: dict[str, Path], tmp_path: Path) -> None:
    told = monitored(tmp_path, voyages["same"], voyages["reference"], "--reference", voyages["reference"])
    assert told["judged_h"] == pytest.approx(2.5, abs=0.05)
    assert told["alarms"] == []
    assert told["history"][-1]["time_s"] > 3.4 * HOUR


def test_a_loss_of_half_the_thrust_is_a_change_and_not_left_out(voyages: dict[str, Path], tmp_path: Path) -> None:
    path = voyage_csv(tmp_path / "half.csv", tender(X_mu=0.5, Y_mu=0.5, N_mu=0.5), HOUR // 2, seed=9)
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    alarm = told["alarms"][0]
    assert alarm["effect"] == "gain"
    assert alarm["value"] == pytest.approx(-0.5, abs=max(5 * alarm["std"], 0.02))


def test_data_unlike_the_reference_are_not_called_the_same_ship(voyages: dict[str, Path], tmp_path: Path) -> None:
    header, *rows = voyages["same"].read_text().splitlines(keepends=True)
    column = header.strip().split(",").index("v_mps")
    rng = np.random.default_rng(1)
    noisy = []
    for row in rows:
        cells = row.strip().split(",")
        cells[column] = f"{float(cells[column]) + 0.2 * rng.standard_normal():.6g}"
        noisy.append(",".join(cells) + "\n")
    path = tmp_path / "noisy.csv"
    path.write_text(header + "".join(noisy))
    told = monitored(tmp_path / "out", path, "--reference", voyages["reference"])
    assert told["not_judged_h"] > 0.9
    assert told["alarms"] == []
    assert "is not known" in told["verdict"][0]
    assert not any("No alarm" in sentence for sentence in told["verdict"])
