"""Run cards: a page for every run, orders that give the commands back, distances that geometry confirms."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from lxml import html

import export_case as case
from expdesign.conventions import to_n_frame
from expdesign.errors import NoPlan
from expdesign.export.card_orders import FARTHEST_DANGER_M, MOST_ORDER_ROWS, ORDER_TOLERANCE, condensed, look_out
from expdesign.export.cards import card_groups, cards_html, run_orders, steady_s
from expdesign.export.report.content import primitive_runs


@cache
def page() -> html.HtmlElement:
    return html.fromstring(cards_html(case.report_content()))


def text(element: html.HtmlElement) -> str:
    return " ".join(element.text_content().split())


def columns(card: html.HtmlElement) -> dict[str, tuple[str, ...]]:
    """Name of a line -> one text for each run of a card."""
    rows = [[text(cell) for cell in row] for row in card.find_class("runs")[0].iter("tr")]
    return {row[0]: tuple(row[1:]) for row in rows}


@pytest.mark.thorough
def test_every_run_is_on_one_card_in_order_and_under_its_name() -> None:
    found = [(number, text(card.find(".//h1"))) for card in page().find_class("card") for number in columns(card)[""]]
    assert [number for number, _ in found] == [f"Run {n}" for n in range(1, len(case.runs()) + 1)]
    for (_, title), name in zip(found, case.runs(), strict=True):
        assert title.endswith(f" of {len(case.runs())}: {name}")


def test_each_run_says_where_when_and_how_to_begin_and_to_stop() -> None:
    plan = case.plan()
    legs = iter([leg for leg in plan.legs if leg.kind == "primitive"])
    for card in page().find_class("card"):
        told = columns(card)
        for place in range(len(told[""])):
            leg = next(legs)
            heading = round(math.degrees(plan.trajectory.pose[leg.first, 2])) % 360
            assert told["Heading"][place] == f"{heading:03d}\N{DEGREE SIGN}"
            assert told["Start time"][place] == f"{leg.first // 3600}:{leg.first // 60 % 60:02d}:{leg.first % 60:02d}"
            assert told["End time"][place] == f"{leg.last // 3600}:{leg.last // 60 % 60:02d}:{leg.last % 60:02d}"
            assert told["Abort if off track by"][place].endswith("m")
            assert told["Start (UTC)"][place] == ""
        for word in ("Purpose", "Abort", "Record", "Remarks", "Orders"):
            assert word in text(card)


def test_runs_with_the_same_orders_share_a_sheet_and_turns_of_a_thruster_do_not_part_them() -> None:
    plan, leg = case.plan(), next(leg for leg in case.plan().legs if leg.kind == "primitive")
    count = leg.last - leg.first
    assert 8 * count < len(plan.commands)
    runs = tuple(replace(leg, first=k * count, last=(k + 1) * count) for k in range(8))
    turns = np.repeat([0, 0, 1, -3, 0, 0, 0, 0], count)
    values = np.zeros((len(plan.commands), 3))
    values[: 8 * count, 0] = np.tile(np.linspace(0, 5, count), 8)
    values[: 8 * count, 1] = 0.5 + 2 * math.pi * turns
    values[5 * count : 6 * count, 2] = 1.0
    commands = replace(plan.commands, names=("n1", "a1", "n2"), values=values)
    content = case.report_content(plan=replace(plan, legs=runs, commands=commands))
    groups = card_groups(content, primitive_runs(content.plan))
    assert [[run.number for run in group] for group in groups] == [[1, 2, 3], [4, 5], [6], [7, 8]]
    assert all(run_orders(content, run)[0, 1] == pytest.approx(0.5) for group in groups for run in group)


def test_the_page_needs_nothing_from_outside_and_a_plan_that_failed_gets_none() -> None:
    source = html.tostring(page(), encoding="unicode")
    assert "src=" not in source
    assert "<script" not in source
    assert all(link.startswith("#") for link in page().xpath("//@href"))
    with pytest.raises(NoPlan, match="not verified"):
        cards_html(case.report_content(plan=case.unverified()))


ODD = "<script>alert('x')</script> & \"Åbo\" \N{SNOWMAN} \x07 訓練"


@pytest.mark.parametrize("name", [ODD, "a very long name " * 30 + "end"])
def test_names_of_any_kind_are_shown_and_never_run(name: str) -> None:
    content = case.report_content()
    first = case.runs()[0]
    information = tuple(
        replace(item, primitive=replace(item.primitive, name=name)) if item.primitive.name == first else item
        for item in content.information
    )
    legs = tuple(replace(leg, name=name) if leg.name == first else leg for leg in content.plan.legs)
    plan = replace(content.plan, legs=legs, area=replace(content.plan.area, name=name, depth_rule=name))
    odd = cards_html(
        replace(content, scenario=name, vessel=replace(content.vessel, name=name), information=information, plan=plan)
    )
    assert "<script" not in odd
    assert "\x07" not in odd
    page = html.fromstring(odd)
    shown = " ".join(name.replace("\x07", "\N{REPLACEMENT CHARACTER}").split())
    assert text(page.find(".//h1")) == f"{shown}: run cards"
    assert text(page.find_class("card")[0].find(".//h1")).endswith(shown)
    cover = page.find_class("cover")[0]
    for title in cover.xpath(".//*[local-name()='svg']//*[local-name()='title']"):
        title.drop_tree()
    assert text(cover).count(shown) == 3


@pytest.mark.parametrize("name", [item.primitive.name for item in case.scored()])
def test_straight_lines_between_the_orders_give_the_commands_back(name: str) -> None:
    values = next(item.primitive for item in case.scored() if item.primitive.name == name).commands.values
    kept, missed = condensed(values)
    lines = np.stack([np.interp(np.arange(len(values)), kept, column[kept]) for column in values.T], axis=1)
    span = np.maximum(np.ptp(values, axis=0), 1e-9)
    assert (np.abs(lines - values) / span)[:, np.ptp(values, axis=0) > 1e-9].max() == pytest.approx(missed, abs=1e-12)
    assert missed <= ORDER_TOLERANCE or len(kept) == MOST_ORDER_ROWS
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
    assert look_out(pose, hull_b=case.tug().hull_b, water=open_sea).ahead_m == FARTHEST_DANGER_M


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
