"""The form of MSC/Circ.1053, appendix 6: both sides beside the criterion, ship and conditions, blanks where unknown."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from lxml import html
from markupsafe import Markup

from expdesign.errors import InputError
from expdesign.export import words
from expdesign.export.indices_form import IndicesContent
from expdesign.export.indices_page import condition_rows, form_rows, indices_document, ship_rows
from expdesign.export.pages import document_html
from expdesign.indices import Circle, criteria, standard_results
from expdesign.requests import Indices
from expdesign.vessel import Vessel
from nomoto_ship import nomoto_ship

SHIP = replace(nomoto_ship(), length_m=180.0, beam_m=30.0, draught_m=10.0)
SPEED = 7.0
WIDE = Circle(
    name="wide.csv", side="port", helm_rad=0.6, speed_mps=SPEED, advance_m=811.0, transfer_m=1.0,
    tactical_diameter_m=899.0, initial_turning_m=1.0, steady_diameter_m=None,
)  # fmt: skip
ODD = "<script>alert('x')</script> & \"Åbo\" 訓練 \x07" + " a very long name" * 20


def content(vessel: Vessel = SHIP, **changes: object) -> IndicesContent:
    given: dict[str, object] = {
        "vessel": vessel,
        "scale": 1.0,
        "simulated": standard_results(vessel, speed_mps=SPEED),
        "simulated_why_not": "",
        "measured": (),
        "notes": (),
    }
    return IndicesContent(**(given | changes))


def test_every_index_stands_under_its_side_beside_its_criterion() -> None:
    form = content()
    found = form.simulated
    limits = {limit.key: limit.limit for limit in criteria(SHIP.length_m, SPEED)}
    rows = [[Markup(cell).striptags() for cell in row] for row in form_rows(form, "simulated")]
    assert [row[1] for row in rows] == [
        "Advance", "Tactical diameter", "First overshoot", "Second overshoot", "First overshoot",
        "Distance to 10° of heading at 10° of helm", "Track reach, full astern",
    ]  # fmt: skip
    port = next(circle for circle in found.circles if circle.side == "port")
    assert rows[0][2].startswith(f"{port.advance_m:.4g} m = {port.advance_m / 180:.2f} L ")
    assert rows[0][4] == "4.5 L = 810 m"
    ten = next(zigzag for zigzag in found.zigzags if zigzag.side == "starboard" and zigzag.helm_rad < 0.2)
    assert rows[3][3].startswith(f"{math.degrees(ten.overshoots_rad[1]):.1f} deg ")
    assert rows[3][4] == f"{math.degrees(limits['second_overshoot_10_10_rad']):.1f} deg at L/V = 25.7 s"
    reach = found.stops[0].track_reach_m
    verdict = "\N{CHECK MARK}" if reach <= limits["track_reach_m"] else "\N{BALLOT X} exceeds"
    assert rows[6][2:4] == [f"{reach:.4g} m = {reach / 180:.2f} L {verdict} no side", ""]


def test_each_run_to_a_side_has_a_line_that_names_it() -> None:
    lines = form_rows(
        content(simulated=None, measured=(WIDE, replace(WIDE, name="next.csv", advance_m=700.0))), "measured"
    )
    assert [(row[:2], Markup(row[2]).striptags().split()[-1], row[3]) for row in lines[:2]] == [
        (("Turning circle", "Advance"), "wide.csv", "no\N{NO-BREAK SPACE}result"),
        (("", ""), "next.csv", ""),
    ]


@pytest.mark.thorough
def test_what_exceeds_its_limit_is_marked_and_what_was_not_run_is_not_shown() -> None:
    page = html.fromstring(document_html(indices_document(content(simulated=None, measured=(WIDE,)))))
    rows = {" ".join(" ".join(row.itertext()).split()) for row in page.iter("tr")}
    assert any(row.startswith("Turning circle Advance 811 m = 4.51 L \N{BALLOT X} exceeds no result") for row in rows)
    assert any(row.startswith("Tactical diameter 899 m = 4.99 L \N{CHECK MARK} no result") for row in rows)


def test_ship_data_are_the_vessels_and_data_without_a_file_stay_open() -> None:
    rows = dict(ship_rows(content()))
    assert rows["Length, beam, mean draught"] == "L 180 m, B 30 m, T 10 m"
    assert (rows["L/B"], rows["B/T"]) == ("6.00", "3.00")
    assert rows["L/V"] == f"{180 / SPEED:.1f} s at {words.speed(SPEED)}"
    assert rows["Block coefficient"] == rows["Type of ship"] == ""
    assert dict(ship_rows(content(scale=25.0)))["L/V"].startswith(f"{180 / SPEED * 5:.1f} s")


@pytest.mark.parametrize(
    ("held", "met"),
    [
        ({}, (None, None, None)),
        ({"depth_m": 40.0, "wind_mps": 10.7, "sea_state": 4}, (False, True, True)),
        ({"depth_m": 40.1, "wind_mps": 10.8, "sea_state": 5}, (True, False, False)),
    ],
)
def test_conditions_are_judged_by_four_draughts_beaufort_five_and_sea_state_four(
    held: dict[str, float], met: tuple[bool | None, ...]
) -> None:
    marks = [Markup(row[3]).striptags() for row in condition_rows(content(**held))[:3]]
    assert marks == [{None: "", True: "\N{CHECK MARK}", False: "\N{BALLOT X} exceeds"}[one] for one in met]


@pytest.mark.parametrize("wrong", [{"depth_m": 0.0}, {"wind_mps": -1.0}, {"sea_state": 10}])
def test_conditions_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    (name,) = wrong
    with pytest.raises(InputError, match=f"--{name.replace('_', '-')} is .*, expected"):
        Indices(vessel=Path("ship.toml"), **wrong)


def test_odd_names_are_shown_and_never_run() -> None:
    odd = document_html(replace(indices_document(content(replace(SHIP, name=ODD), notes=(ODD,))), command=ODD))
    twice = (replace(WIDE, name=ODD), replace(WIDE, name=f"{ODD} again"))
    odd += document_html(indices_document(content(measured=twice)))
    assert "<script" not in odd
    assert "\x07" not in odd
    assert "http" not in odd
    assert html.fromstring(odd).find(".//h1").text_content() == ODD.replace("\x07", "\N{REPLACEMENT CHARACTER}")
