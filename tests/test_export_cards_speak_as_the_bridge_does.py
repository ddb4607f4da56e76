"""Run cards and charts in the words of a bridge: helm to port and starboard, zig-zags by heading, degrees, knots."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from lxml import html

import export_case as case
from expdesign.conventions import KNOTS_PER_MPS
from expdesign.export import words
from expdesign.export.cards import cards_html
from expdesign.export.cards.orders import order_rows, orders_notes, starboard_helm
from expdesign.export.report.criteria import short_of_optimum
from expdesign.export.report.figures.chart import shown_depths
from expdesign.export.report.tables import agenda, shown_name
from expdesign.export.tuning import TUNING
from expdesign.plan.values import Leg
from expdesign.signals import Commands
from expdesign.simulation import simulate, steady_ahead
from rudder_ship import rudder_ship


def test_the_side_of_a_helm_order_is_the_side_the_ship_turns_to() -> None:
    ship = rudder_ship()
    approach = steady_ahead(ship)
    for angle in (0.2, -0.3):
        values = np.tile([approach.inputs[0], angle], (30, 1))
        commands = Commands(sample_time_s=1.0, names=ship.model.inputs, values=values)
        turned = simulate(ship, commands, pose=(0, 0, 0), velocity=approach.velocity).pose[-1, 2]
        rows, _ = order_rows(ship, values, 1.0)
        assert rows[0][2] == f"{'S' if turned > 0 else 'P'}{words.NB}{np.degrees(abs(angle)):.1f}"
    assert order_rows(ship, np.tile([2.0, 0.0], (5, 1)), 1.0)[0][0][2] == "0"


def test_ships_without_a_rudder_have_no_helm_to_order() -> None:
    assert starboard_helm(case.tug()) == 0


@pytest.mark.parametrize(("helm_rad", "sides"), [(0.2618, ("S 15", "P 15")), (-0.2618, ("P 15", "S 15"))])
def test_a_zigzag_switched_by_heading_is_ordered_by_heading(helm_rad: float, sides: tuple[str, str]) -> None:
    settings = {"helm_rad": helm_rad, "heading_rad": np.radians(10.0)}
    told = {}
    for family in ("zigzag_heading", "turning_circle_helm"):
        primitive = SimpleNamespace(name="z", family=family, settings=settings)
        content = SimpleNamespace(
            information=(SimpleNamespace(primitive=primitive),), vessel=rudder_ship(), plan=case.plan()
        )
        told[family] = " ".join(orders_notes(content, Leg(kind="primitive", name="z", first=0, last=60), [()], 0.0))
    first, other = sides
    assert "By heading".lower() in told["zigzag_heading"].lower()
    assert f"course order {first}. " in told["zigzag_heading"]
    assert f"changed by 10\N{DEGREE SIGN} to that side, order {other}." in told["zigzag_heading"]
    assert "by heading" not in told["turning_circle_helm"]


def test_names_show_angles_in_degrees_and_nothing_else_changes() -> None:
    name = "turn-helm-0.349065850399-duration-60"
    settings = {"helm_rad": 0.34906585039886592, "duration_s": 60.0, "heading_rad": 0.2}
    item = SimpleNamespace(primitive=SimpleNamespace(name=name, settings=settings))
    assert shown_name(item) == "turn-helm-20\N{DEGREE SIGN}-duration-60"
    plain = SimpleNamespace(primitive=SimpleNamespace(name="turn-0.2", settings=settings))
    assert shown_name(plain) == "turn-0.2"


def test_the_agenda_gives_speeds_in_knots_too() -> None:
    for row in agenda(case.report_content()):
        ends = [[float(part.replace(words.MINUS, "-")) for part in text.split("\N{RIGHTWARDS ARROW}")]
                for text in (row.speed, row.knots)]  # fmt: skip
        assert ends[1] == pytest.approx(np.array(ends[0]) * KNOTS_PER_MPS, abs=0.05 * KNOTS_PER_MPS + 0.05)
    heads = [cell.text_content() for cell in html.fromstring(cards_html(case.report_content())).iter("th")]
    assert "Speed kn" in heads


@pytest.mark.parametrize("count", [0, 1, 3, 18])
def test_a_legend_names_few_depths_with_the_shallowest_and_the_deepest(count: int) -> None:
    named = shown_depths(count)
    assert len(named) == min(count, TUNING.legend_depths)
    assert not count or {0, count - 1} <= named <= set(range(count))


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-5, 1e-2])
def test_the_stated_distance_from_the_optimum_is_a_bound_with_few_digits(gap: float) -> None:
    content = SimpleNamespace(
        parameters=tuple("abc"),
        design=SimpleNamespace(gap=gap, problem=SimpleNamespace(aim=SimpleNamespace(criterion="D"))),
    )
    text = short_of_optimum(content)
    assert float(text.split(words.NB)[0]) / 100 >= np.expm1(gap / len(content.parameters))
    assert len(text.split(words.NB)[0]) <= 5
