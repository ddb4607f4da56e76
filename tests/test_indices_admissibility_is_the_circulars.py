"""A planned trial is admissible exactly within the limits of MSC/Circ.1053, and unknown conditions are not met."""

from dataclasses import replace
from pathlib import Path

import pytest

import export_case as case
from expdesign.errors import FileError, InputError
from expdesign.export.files import plan_json
from expdesign.export.folder import write_files
from expdesign.export.report.checks import conditions
from expdesign.export.routes import read_plan
from expdesign.indices import BEAUFORT_MPS, Conditions, admissibility, beaufort
from expdesign.scenario import load_scenario
from expdesign.simulation import Environment
from scenario_files import spoil, write_scenario

KNOWN = Conditions(
    draught_m=5.0,
    least_depth_m=25.0,
    wind_mps=8.0,
    wind_std_mps=1.0,
    sea_state=3,
    current_mps=0.2,
    current_std_mps=0.1,
    room_m=40.0,
    required_room_m=30.0,
)


def met(**changes: object) -> dict[str, bool | None]:
    return {row.what: row.met for row in admissibility(replace(KNOWN, **changes))}


def test_beaufort_numbers_begin_at_their_speeds() -> None:
    for number, speed in enumerate(BEAUFORT_MPS, start=1):
        assert (beaufort(speed - 1e-6), beaufort(speed)) == (number - 1, number)


@pytest.mark.parametrize(("depth", "expected"), [(20.0, False), (20.1, True), (None, None)])
def test_depth_is_more_than_four_draughts(depth: float | None, expected: bool | None) -> None:
    assert met(least_depth_m=depth)["Water depth under the track"] is expected


@pytest.mark.parametrize(
    ("wind", "std", "expected"), [(10.7, 0.0, True), (10.9, 0.0, False), (10.0, 1.0, None), (8.0, 1.3, True)]
)
def test_wind_is_beaufort_five_at_most_and_a_forecast_that_may_pass_it_leaves_it_open(
    wind: float, std: float, expected: bool | None
) -> None:
    assert met(wind_mps=wind, wind_std_mps=std)["Wind"] is expected


@pytest.mark.parametrize(("state", "expected"), [(4, True), (5, False), (None, None)])
def test_sea_state_is_four_at_most(state: int | None, expected: bool | None) -> None:
    assert met(sea_state=state)["Sea state"] is expected


def test_room_is_compared_with_the_required_and_a_uniform_current_stays_open() -> None:
    assert met()["Sea room"] is True
    assert met(room_m=29.9)["Sea room"] is False
    assert met()["Current"] is None


@pytest.mark.parametrize(("state", "expected"), [(4, True), (5, False), (None, None)])
def test_the_sea_state_of_a_scenario_decides_and_travels_with_the_plan(
    state: int | None, expected: bool | None, tmp_path: Path
) -> None:
    path = write_scenario(tmp_path)
    if state is not None:
        spoil(path, "[environment]", f"[environment]\nsea_state = {state}")
    environment = load_scenario(path).environment
    judged = {row.what: row.met for row in conditions(case.report_content(environment=environment))}
    assert judged["Sea state"] is expected
    text = plan_json(case.plan(), scenario="s", vessel=case.tug(), environment=environment, clearance_m=20.0)
    write_files(tmp_path / "out", {**case.plan_files(), "plan.json": text})
    assert read_plan(tmp_path / "out" / "plan.json").environment.sea_state == state


@pytest.mark.parametrize("state", ["10", "-1", "3.5", '"rough"'])
def test_a_sea_state_that_is_none_is_refused(state: str, tmp_path: Path) -> None:
    path = write_scenario(tmp_path)
    spoil(path, "[environment]", f"[environment]\nsea_state = {state}")
    with pytest.raises(FileError, match=r"environment\.sea_state"):
        load_scenario(path)
    with pytest.raises(InputError, match="from 0 to 9"):
        Environment(sea_state=12)
