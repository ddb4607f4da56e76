"""What is stated and does nothing in a trial is a line on the terminal and in the report: a walk through the kinds."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from expdesign.cli import main
from expdesign.workflows import new


def _replaced(path: Path, pattern: str, by: str) -> None:
    text, count = re.subn(pattern, by, path.read_text("utf-8"), count=1, flags=re.DOTALL)
    assert count == 1
    path.write_text(text, "utf-8")


def _wind(folder: Path) -> None:
    _replaced(
        folder / "scenario.toml", r"\[environment\]\n", "[environment]\nwind_to = { north_mps = 5.0, east_mps = 0.0 }\n"
    )


def _unstated(folder: Path) -> None:
    _replaced(folder / "vessel.toml", r"X_vr = 0\.13\n", "")


def _known(folder: Path) -> None:
    _replaced(folder / "vessel.toml", r"Y_vv = 0\.004\n", "Y_vv = 0.0\n")


def _limit(folder: Path) -> None:
    _replaced(
        folder / "vessel.toml",
        r"speed_min_rps = -5\.0\nspeed_max_rps = 5\.0",
        "speed_min_rps = -50.0\nspeed_max_rps = 50.0",
    )


def _idle(folder: Path) -> None:
    """Runs, and legs, that need no tunnel thruster."""
    _replaced(folder / "dictionary.toml", r'\[\[primitives\]\]\nname = "zigzag"\n.*', "")
    without = '["Y_T3", "Y_uT3", "N_T3", "N_uT3", "X_T2", "Y_T2", "N_T2"]'
    _replaced(folder / "scenario.toml", r'criterion = "D"\n', f'criterion = "D"\nfixed_parameters = {without}\n')


def _far_zone(folder: Path) -> None:
    zone = "polygon = [[58.2, 11.0], [58.21, 11.0], [58.21, 11.01]]"
    path = folder / "area.toml"
    path.write_text(f'{path.read_text("utf-8")}\n[[no_go]]\nname = "elsewhere"\n{zone}\n', "utf-8")


KINDS: dict[str, tuple[Callable[[Path], None], str]] = {
    "a wind that no term reads": (_wind, "environment.wind_to moves no ship here"),
    "a parameter without a standard deviation": (_unstated, "no model.parameter_std of X_vr"),
    "a parameter that is said to be known": (_known, "exactly known"),
    "a limit that is never reached": (_limit, "n3_rps ("),
    "a thruster that nothing uses": (_idle, "uses n3_rps"),
    "a no-go zone outside the bounds": (_far_zone, "no-go zone 'elsewhere' lies"),
}


def test_a_file_in_which_everything_acts_is_told_of_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """So that the lines below are not said always."""
    from expdesign.scenario import load_scenario

    case = load_scenario(new(tmp_path / "trial", kind="azimuth").files[0])
    told = " ".join((*case.remarks, *case.area.notes))
    assert not any(line in told for _, line in KINDS.values())


@pytest.mark.thorough
@pytest.mark.parametrize("kinds", [KINDS.keys() - {"a thruster that nothing uses"}, ["a thruster that nothing uses"]])
def test_what_does_not_act_is_said_on_the_terminal_and_in_the_report(
    kinds: Iterable[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    new(Path("trial"), kind="azimuth")
    for kind in kinds:
        KINDS[kind][0](Path("trial"))
    assert main(["run", "trial/scenario.toml", "--draft", "--out", "out"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    page = html.unescape(re.sub(r"<[^>]+>", " ", Path("out/report.html").read_text("utf-8")))
    for kind in kinds:
        line = KINDS[kind][1]
        assert line in told, kind
        assert line in " ".join(page.split()), kind
