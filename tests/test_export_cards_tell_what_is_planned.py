"""Run cards: a page for every run, orders that give the commands back, distances that geometry confirms."""

import math
from functools import cache

import export_case as case
import numpy as np
import pytest
import shapely
from lxml import html

from expdesign.conventions import to_n_frame
from expdesign.errors import NoPlan
from expdesign.export.cards import cards_html
from expdesign.export.cards.card import steady_s
from expdesign.export.cards.danger import FARTHEST_M, look_out
from expdesign.export.cards.orders import MOST_ROWS, TOLERANCE, condensed


@cache
def page() -> html.HtmlElement:
    return html.fromstring(cards_html(case.report_content()))


def text(element: html.HtmlElement) -> str:
    return " ".join(element.text_content().split())


def test_every_run_has_its_card_in_order() -> None:
    titles = [text(card.find(".//h1")) for card in page().find_class("card")]
    assert titles == [f"Run {n} of {len(case.runs())}: {name}" for n, name in enumerate(case.runs(), start=1)]


def test_each_card_says_where_when_and_how_to_begin_and_to_stop() -> None:
    plan = case.plan()
    legs = [leg for leg in plan.legs if leg.kind == "primitive"]
    for card, leg in zip(page().find_class("card"), legs, strict=True):
        told = text(card)
        heading = round(math.degrees(plan.trajectory.pose[leg.first, 2])) % 360
        assert f"{heading:03d}\N{DEGREE SIGN}" in told
        assert f"{leg.first // 3600}:{leg.first // 60 % 60:02d}:{leg.first % 60:02d}" in told
        assert f"{leg.last // 3600}:{leg.last // 60 % 60:02d}:{leg.last % 60:02d}" in told
        for word in ("Purpose", "Abort", "Stop", "Record", "Remarks", "Sea state"):
            assert word in told


def test_the_page_needs_nothing_from_outside_and_a_plan_that_failed_gets_none() -> None:
    source = html.tostring(page(), encoding="unicode")
    assert "src=" not in source
    assert "<script" not in source
    assert all(link.startswith("#") for link in page().xpath("//@href"))
    with pytest.raises(NoPlan, match="not verified"):
        cards_html(case.report_content(plan=case.unverified()))


def test_odd_names_are_shown_and_never_run() -> None:
    odd = cards_html(case.report_content(scenario="<script>alert('x')</script> & Åbo"))
    assert "<script>" not in odd
    assert "Åbo" in text(html.fromstring(odd))


@pytest.mark.parametrize("name", [item.primitive.name for item in case.scored()])
def test_straight_lines_between_the_orders_give_the_commands_back(name: str) -> None:
    values = next(item.primitive for item in case.scored() if item.primitive.name == name).commands.values
    kept, missed = condensed(values)
    lines = np.stack([np.interp(np.arange(len(values)), kept, column[kept]) for column in values.T], axis=1)
    span = np.maximum(np.ptp(values, axis=0), 1e-9)
    assert (np.abs(lines - values) / span)[:, np.ptp(values, axis=0) > 1e-9].max() == pytest.approx(missed, abs=1e-12)
    assert missed <= TOLERANCE or len(kept) == MOST_ROWS
    assert (kept[0], kept[-1]) == (0, len(values) - 1)


def test_distances_to_danger_are_those_of_a_known_channel() -> None:
    """A ship 30 m by 10 m going north in a channel 200 m wide and 1000 m long, 20 m east of its middle."""
    water = shapely.MultiPolygon([shapely.box(-100, -500, 100, 500)])
    pose = np.stack([np.linspace(-200, 100, 31), np.full(31, 20.0), np.zeros(31)], axis=1)
    seen = look_out(pose, hull_b=case.tug().hull_b, water=water)
    assert seen.ahead_m == pytest.approx(500 - 100 - 15)
    assert seen.port_m == pytest.approx(120 - 5)
    assert seen.starboard_m == pytest.approx(80 - 5)
    assert seen.nearest_m == pytest.approx(75)
    assert seen.room_m == pytest.approx((330, 10))
    open_sea = shapely.MultiPolygon([shapely.box(-1e5, -1e5, 1e5, 1e5)])
    assert look_out(pose, hull_b=case.tug().hull_b, water=open_sea).ahead_m == FARTHEST_M


def test_no_side_is_nearer_than_the_nearest_danger() -> None:
    plan = case.plan()
    for leg in (leg for leg in plan.legs if leg.kind == "primitive"):
        pose = plan.trajectory.pose[leg.first : leg.last + 1]
        seen = look_out(pose, hull_b=case.tug().hull_b, water=plan.area.water)
        assert min(seen.ahead_m, seen.port_m, seen.starboard_m) >= seen.nearest_m - 1e-6
        hull = shapely.Polygon(to_n_frame(case.tug().hull_b, pose[seen.nearest_sample])[:, ::-1])
        assert plan.area.water.boundary.distance(hull) == pytest.approx(seen.nearest_m)


def test_steady_time_is_the_time_without_change() -> None:
    plan = case.plan()
    first = next(leg.first for leg in plan.legs if leg.kind == "primitive")
    seconds = steady_s(case.report_content(), first)
    motion = plan.trajectory
    before = slice(first - round(seconds), first + 1)
    assert np.ptp(motion.pose[before, 2]) < math.radians(6)
    assert seconds <= first
