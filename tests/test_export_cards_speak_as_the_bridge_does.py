"""Run cards and charts in the words of a bridge: helm to port and starboard, zig-zags by heading, degrees, knots."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from lxml import html

import export_case as case
from expdesign.conventions import KNOTS_PER_MPS
from expdesign.export import words
from expdesign.export.card_orders import heading_rows, order_rows, orders_notes, starboard_helm
from expdesign.export.cards import cards_html
from expdesign.export.report.chart import chart_legend, deep_from, safety_contour
from expdesign.export.report.design import short_of_optimum
from expdesign.export.report.tables import agenda, setting
from expdesign.plan.values import Leg
from expdesign.sea_area import SeaArea, as_multipolygon
from expdesign.signals import Commands
from expdesign.simulation import Conduct, simulate, steady_ahead, zigzag
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


def test_names_show_settings_as_people_say_them_and_nothing_else_changes() -> None:
    settings = {"helm_rad": -0.34906585039886592, "duration_s": 60.0, "heading_rad": 0.2}
    for name, said in (
        (
            "turn-helm--0.349065850399-duration-60",
            f"turn, helm 20\N{DEGREE SIGN}{words.NB}to port, duration 60{words.NB}s",
        ),
        ("turn-0.2", "turn-0.2"),
    ):
        assert words.names([(name, "turn", settings)]) == {name: said}


def test_names_show_speeds_in_knots_and_two_names_are_never_shown_alike() -> None:
    of = [(f"circle-speed-{speed:.12g}", "circle", {"speed_mps": speed}) for speed in (5.0, 5.001, 2.5)]
    assert words.names(of[:1]) == {"circle-speed-5": f"circle, speed 9.7{words.NB}kn"}
    assert list(words.names(of).values()) == ["circle-speed-5", "circle-speed-5.001", f"circle, speed 4.9{words.NB}kn"]


def test_what_a_search_added_is_called_by_its_family_and_a_letter() -> None:
    found = [f"added-{number}-{'zigzag' if number % 2 else 'turning-circle'}" for number in range(1, 60)]
    said = words.names((name, name.split("-", 2)[2].replace("-", "_"), {}) for name in found)
    assert [said[name] for name in found[:4]] == [
        f"{family}{words.NB}{letter}" for letter in "AB" for family in ("Zig-zag", "Turning circle")
    ]
    assert said["added-53-zigzag"] == f"Zig-zag{words.NB}AA"
    assert len(set(said.values())) == len(found)
    own = words.names([("added-by-hand", "zigzag", {})])
    assert own == {"added-by-hand": "added-by-hand"}


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("speed_mps", 2.0, "speed 2 m/s (3.9 kn)"),
        ("sway_mps", -0.5, "sway \N{MINUS SIGN}0.5 m/s (\N{MINUS SIGN}1.0 kn)"),
        ("helm_rad", np.radians(35.0), "helm 35\N{DEGREE SIGN}"),
        ("yaw_rate_radps", np.radians(2.0), "yaw rate 2 \N{DEGREE SIGN}/s"),
        ("draw", 2.0, "draw 2"),
    ],
)
def test_settings_are_said_in_knots_and_degrees(name: str, value: float, said: str) -> None:
    assert setting(name, value).replace(words.NB, " ") == said


@pytest.mark.parametrize("helm_deg", [10.0, -20.0])
def test_a_sheet_by_heading_has_a_row_for_each_order_of_the_helm(helm_deg: float) -> None:
    """The simulated heading agrees with the rows: the helm changes where the heading has."""
    ship, size = rudder_ship(), abs(helm_deg)
    side = "starboard" if helm_deg > 0 else "port"
    commands, motion = zigzag(
        ship, heading_rad=np.radians(size), helm_rad=np.radians(size), side=side, conduct=Conduct(duration_s=300.0)
    )
    settings = {"helm_rad": np.radians(helm_deg), "heading_rad": np.radians(size)}
    spec = SimpleNamespace(family="zigzag_heading", settings=settings)
    rows = heading_rows(spec, ship, commands.values, commands.sample_time_s)
    assert len(rows) >= 3
    assert rows[-1][1] == "end of the run"
    for helm, until, seconds in rows[:-1]:
        turned = np.degrees(motion.pose[round(float(seconds) / commands.sample_time_s), 2])
        assert helm == f"{until.split()[-1][0].upper()}{words.NB}{size:g}"
        assert until.startswith(f"{size:g}\N{DEGREE SIGN} to {'starboard' if turned > 0 else 'port'}")
        assert abs(turned) >= size - 0.5


def test_the_agenda_gives_speeds_in_knots_too() -> None:
    for row in agenda(case.report_content()):
        ends = [[float(part.replace(words.MINUS, "-")) for part in text.split("\N{RIGHTWARDS ARROW}")]
                for text in (row.speed, row.knots)]  # fmt: skip
        assert ends[1] == pytest.approx(np.array(ends[0]) * KNOTS_PER_MPS, abs=0.05 * KNOTS_PER_MPS + 0.05)
    heads = [cell.text_content() for cell in html.fromstring(cards_html(case.report_content())).iter("th")]
    assert "Speed kn" in heads


def charted(*depths_m: float, needed_m: float = 0.0, nested: bool = False) -> SeaArea:
    """Strips of water a hundred metres wide, each with its least depth; allowed from the depth that is needed."""
    widths = [1 + len(depths_m) if nested else k + 1 for k in range(len(depths_m))]
    strips = [shapely.box(100.0 * k, -500, 100.0 * end, 500) for k, end in enumerate(widths)]
    water = shapely.union_all([strip for depth, strip in zip(depths_m, strips, strict=True) if depth >= needed_m])
    layers = tuple((depth, as_multipolygon(strip)) for depth, strip in zip(depths_m, strips, strict=True))
    return replace(case.plan().area, water=as_multipolygon(water), depths=layers)


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize(("needed_m", "contour"), [(3.5, 5.0), (5.0, 5.0), (0.5, 2.0), (11.0, 20.0)])
def test_the_safety_contour_is_the_first_charted_depth_that_is_deep_enough(
    needed_m: float, contour: float, nested: bool
) -> None:
    assert safety_contour(charted(2.0, 5.0, 10.0, 20.0, needed_m=needed_m, nested=nested)) == contour


def test_no_contour_is_drawn_where_depth_does_not_bound_the_water() -> None:
    assert safety_contour(case.plan().area) is None
    assert safety_contour(replace(charted(5.0, 10.0), water=case.plan().area.water)) is None


def test_deep_water_is_four_draughts_deep_and_beyond_the_safety_contour() -> None:
    area = charted(2.0, 5.0, 10.0, 20.0, needed_m=3.5)
    assert [deep_from(area, draught) for draught in (1.0, 2.5, 2.6, 6.0)] == [None, 10.0, 20.0, None]


@pytest.mark.parametrize("count", [1, 3, 18])
def test_a_chart_has_three_shades_of_water_however_many_depths_are_charted(count: int) -> None:
    area = charted(*np.linspace(2.0, 40.0, count).tolist(), needed_m=2.0)
    content = case.report_content(plan=replace(case.plan(), area=area))
    told = [entry["text"] for entry in chart_legend(content)]
    assert sum("m or more" in text or "shallower" in text or " to " in text for text in told) <= 3
    assert len(set(told)) == len(told) <= 13
    assert sum("safety contour" in text for text in told) == 1


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-5, 1e-2])
def test_the_stated_distance_from_the_optimum_is_a_bound_with_few_digits(gap: float) -> None:
    content = SimpleNamespace(
        parameters=tuple("abc"),
        design=SimpleNamespace(gap=gap, problem=SimpleNamespace(aim=SimpleNamespace(criterion="D"))),
    )
    text = short_of_optimum(content)
    assert float(text.split(words.NB)[0]) / 100 >= np.expm1(gap / len(content.parameters))
    assert len(text.split(words.NB)[0]) <= 5
