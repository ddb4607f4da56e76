"""A planned trial is admissible exactly within the limits of MSC/Circ.1053, and what is not known is not called met."""

from dataclasses import replace

import pytest

from expdesign.indices import BEAUFORT_MPS, Conditions, admissibility, beaufort

KNOWN = Conditions(
    draught_m=5.0,
    least_depth_m=25.0,
    wind_mps=8.0,
    wind_std_mps=1.0,
    sea_state=3,
    current_mps=0.2,
    current_std_mps=0.1,
    room_m=40.0,
    room_asked_m=30.0,
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


def test_room_is_what_was_asked_for_and_uniform_current_is_for_the_day_to_show() -> None:
    assert met()["Sea room"] is True
    assert met(room_m=29.9)["Sea room"] is False
    assert met()["Current"] is None
