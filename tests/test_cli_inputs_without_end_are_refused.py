"""Inputs that would take for ever end at once, and what is given for something else is called what it is."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from lxml import etree

import export_case as case
from expdesign.cli import main
from expdesign.errors import FileError, InputError
from expdesign.export.folder import write_files
from expdesign.export.formats import find_format
from expdesign.export.formats.check import check_rtz
from expdesign.export.routes import build_bridge_route
from expdesign.scenario import load_scenario
from expdesign.workflows.steps.planned import MOST_RUNS, plan_problem
from scenario_files import SCENARIOS, spoil, write_scenario


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The line that a command ends with, of status 2; what comes before is progress."""
    assert main(arguments) == 2
    *_, line = capsys.readouterr().err.strip().splitlines()
    return line


def _device(path: Path) -> None:
    path.symlink_to("/dev/zero")


@pytest.mark.skipif(os.name != "posix", reason="makes devices and pipes")
@pytest.mark.parametrize(("make", "kind"), [(_device, "a device"), (os.mkfifo, "a pipe")])
@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "{}"],
        ["whatif", str(SCENARIOS / "harbour.toml"), "{}"],
        ["plan", str(SCENARIOS / "harbour.toml"), "--durations", "{}"],
        ["export", "{}", "--format", "rtz"],
        ["simulate", "{}", "--truth", str(SCENARIOS / "vessels" / "tender-20m.toml")],
        ["estimate", "{}", "--vessel", str(SCENARIOS / "vessels" / "tender-20m.toml")],
        ["diagnose", "{}", "--vessel", str(SCENARIOS / "vessels" / "tender-20m.toml")],
        ["indices", "{}", "--vessel", str(SCENARIOS / "vessels" / "tender-20m.toml")],
        ["check-route", "{}"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_devices_and_pipes_are_no_input(
    make: Callable[[Path], None],
    kind: str,
    arguments: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    endless = tmp_path / "endless.rtz"
    make(endless)
    line = refused([part.format(endless) for part in arguments], capsys)
    assert f"endless.rtz: is {kind}, expected" in line
    assert list(tmp_path.iterdir()) == [endless]


def test_a_trial_of_thousands_of_years_is_refused(tmp_path: Path) -> None:
    path = write_scenario(tmp_path)
    spoil(path, "total_s = 600", "total_s = 1e12")
    with pytest.raises(FileError, match=r"design.total_s: is 1e\+12, expected at most 1000000, eleven days"):
        load_scenario(path)


def test_more_runs_than_a_plan_can_have_are_refused_before_planning() -> None:
    scenario = load_scenario(SCENARIOS / "harbour.toml")

    class Design:
        repeats = (MOST_RUNS, 1)

    with pytest.raises(InputError, match=f"has {MOST_RUNS + 1} runs, expected at most {MOST_RUNS} in one"):
        plan_problem(scenario, (), Design())


def test_a_list_of_very_many_settings_is_counted_in_linear_time(tmp_path: Path) -> None:
    """So many that counting each among all would take minutes."""
    path = write_scenario(tmp_path)
    dictionary = tmp_path / "dictionary.toml"
    row = f"[[primitives]]\nfamily = 'telegraph'\ndraw = {list(range(200_000))}\n"
    dictionary.write_text(dictionary.read_text() + row)
    with pytest.raises(FileError, match=r"makes 200000 primitives, expected at most"):
        load_scenario(path)


def test_more_simulated_trials_than_end_in_a_day_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for command, option in (("validate", "--trials"), ("durations", "--monte-carlo")):
        line = refused([command, str(SCENARIOS / "harbour.toml"), option, "200000"], capsys)
        assert (
            f"{option} is 200000, expected at least 0 and at most 100000" in line or "expected at most 100000" in line
        )


@pytest.mark.thorough
def test_a_route_of_very_many_waypoints_is_checked_in_linear_time() -> None:
    """So many that looking for each among all would take minutes; repeated ids are still found."""
    root = etree.fromstring(find_format("rtz").write(build_bridge_route(case.planned())))
    space = f"{{{etree.QName(root).namespace}}}"
    waypoints, manual = root.find(f"{space}waypoints"), root.find(f"{space}schedules/{space}schedule/{space}manual")
    for group in (waypoints, manual):
        for element in list(group):
            group.remove(element)
    for number in range(30_000):
        point = etree.SubElement(waypoints, f"{space}waypoint", id=str(min(number, 29_998)), revision="0")
        etree.SubElement(point, f"{space}position", lat=f"{60.0 + 1e-4 * number:.4f}", lon="24.0")
        etree.SubElement(manual, f"{space}scheduleElement", waypointId=str(min(number, 29_998)))
    size, *problems = check_rtz(etree.tostring(root), "route")
    assert "bytes, expected less than" in size
    assert problems == [
        "waypoint id 29998 is given 2 times, expected once", "schedule does not follow the order of the waypoints"
    ]  # fmt: skip


KILLED = """
import os, signal, sys
from pathlib import Path
from expdesign.export.folder import write_files
count = 0
real = Path.replace
def replace(path, target):
    global count
    count += 1
    if count == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return real(path, target)
Path.replace = replace
write_files(Path(sys.argv[1]), {"a.txt": "new a", "b.txt": "new b", "c.txt": "new c"})
"""


@pytest.mark.skipif(os.name != "posix", reason="kills a process")
def test_the_next_run_clears_what_a_killed_one_left(tmp_path: Path) -> None:
    write_files(tmp_path, {"a.txt": "old a", "b.txt": "old b"})
    (tmp_path / ".notes.new").write_text("of the user")
    ended = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], check=False)
    assert ended.returncode == -9
    left = {path.name for path in tmp_path.iterdir() if re.search(r"-[0-9a-f]{12}\.(new|old)$", path.name)}
    assert len(left) == 4  # b and c are not in place; what a and b were before
    write_files(tmp_path, {"d.txt": "d"})
    assert {path.name for path in tmp_path.iterdir()} == {"a.txt", "b.txt", "d.txt", ".notes.new"}


def test_files_of_a_run_that_goes_on_are_left_alone(tmp_path: Path) -> None:
    theirs = tmp_path / f".a.txt.{os.getpid()}-0123456789ab.new"
    theirs.write_text("being written")
    write_files(tmp_path, {"d.txt": "d"})
    assert theirs.exists()


@pytest.mark.parametrize("below", ["", "sub"])
def test_a_link_to_nothing_is_called_that(below: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    link = tmp_path / "results"
    link.symlink_to(tmp_path / "nowhere")
    line = refused(["score", str(SCENARIOS / "harbour.toml"), "--out", str(link / below)], capsys)
    assert f"results is a link to {tmp_path / 'nowhere'}, which does not exist" in line
    with pytest.raises(FileError, match="is a link to nothing, expected a folder"):
        write_files(link, {"a.txt": "a"})


@pytest.mark.parametrize("name", ["scenario.toml", "durations.json"])
def test_what_is_no_plan_is_told_which_command_makes_one(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_text("[scenario]\n" if name.endswith("toml") else '{"criterion": "D"}')
    line = refused(["export", str(path), "--format", "rtz"], capsys)
    assert "expected a plan.json as expdesign plan and expdesign run write it" in line
    assert ("is a TOML file" in line) == name.endswith("toml")


def test_a_toml_given_for_durations_is_told_which_command_makes_them(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = str(SCENARIOS / "harbour.toml")
    line = refused(["plan", scenario, "--durations", scenario], capsys)
    assert "expected a durations.json as expdesign durations and expdesign run write it" in line


@pytest.mark.parametrize("variant", sorted((SCENARIOS / "variants").glob("*.toml")), ids=lambda path: path.stem)
def test_a_variant_given_as_a_scenario_is_shown_the_way(variant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(["run", str(variant)], capsys)
    assert f"expdesign whatif SCENARIO.toml {variant}" in line
