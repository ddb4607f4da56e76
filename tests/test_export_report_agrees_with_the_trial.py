"""The report is one page that stands alone, says what the values say, and survives odd names."""

import math
import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from lxml import etree
from lxml import html as lxml_html

import export_case as case
from expdesign import __version__
from expdesign.durations import MEAN_SUBTRACTIONS, build_durations, solve_durations
from expdesign.export import words
from expdesign.export.pages.figures import new_figure, report_style, round_ticks, svg
from expdesign.export.report import page as report_page
from expdesign.export.report import report_html
from expdesign.export.report.chart import chart, draw_position_ticks, footprints, nice_step, place_labels, sea_figure
from expdesign.export.report.checks import least_charted_depth
from expdesign.export.report.content import information_rate, primitive_runs, relative_information
from expdesign.export.report.design import chain, parameter_rows
from expdesign.export.routes import build_route
from expdesign.growing.search import GrowRound, Growth
from expdesign.information.expected import TrialPart, expected_covariance
from expdesign.simulation import CALM
from expdesign.vessel import Sensors
from expdesign.vessel.vessel import hull_polygons

ODD = 'x <script>alert(1)</script> & "$\\alpha$" $ \x07 \N{SNOWMAN}'


class Page(HTMLParser):
    """Text, ids, tags and references of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.words: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id" and value:
                self.ids.append(value)
            if name in ("src", "href", "xlink:href") and value:
                self.references.append(value)

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@cache
def page() -> str:
    return report_html(case.report_content())


@pytest.fixture
def _no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages of which only the words are read are not drawn."""
    monkeypatch.setattr(report_page, "_drawn", lambda figures, *, draft: dict.fromkeys(map(id, figures), ""))


@cache
def odd_page(name: str = ODD) -> str:
    renamed = replace(case.scored()[0].primitive, name=name)
    information = (replace(case.scored()[0], primitive=renamed), *case.scored()[1:])
    problem = replace(case.design().problem, names=(name, *case.design().problem.names[1:]))
    legs = (replace(case.plan().legs[0], name=name), *case.plan().legs[1:])
    area = replace(case.plan().area, name=name, source=name, notes=(name,))
    return report_html(
        case.report_content(
            scenario=name,
            vessel=replace(case.tug(), name=name),
            information=information,
            design=replace(case.design(), problem=problem),
            plan=replace(case.plan(), legs=legs, area=area),
            command=name,
        )
    )


@pytest.mark.thorough
def test_the_page_needs_nothing_from_outside() -> None:
    read = Page(page())
    assert all(reference.startswith("#") for reference in read.references)
    assert not {"link", "iframe", "img"} & set(read.tags)
    assert read.tags.count("script") == 1  # its own, which zooms the chart
    assert "fetch" not in page()
    assert "XMLHttpRequest" not in page()
    assert not re.search(r"url\((?!#)|@import", page())


def test_ids_are_unique_and_every_reference_finds_its_target() -> None:
    read = Page(page())
    assert len(set(read.ids)) == len(read.ids)
    inside = {reference[1:] for reference in read.references} | set(re.findall(r"url\(#([^)]+)\)", page()))
    assert inside <= set(read.ids)


@pytest.mark.thorough
def test_every_figure_is_well_formed_and_has_a_label() -> None:
    for html in (page(), odd_page()):
        figures = re.findall(r"<svg.*?</svg>", html, flags=re.DOTALL)
        assert len(figures) == 4 + len(case.scored())
        assert all(etree.fromstring(figure).get("aria-label") for figure in figures)


def test_odd_names_are_shown_and_never_run() -> None:
    html = odd_page()
    read = Page(html)
    assert read.tags.count("script") == 1
    assert "\x07" not in html
    assert 'x <script>alert(1)</script> & "$\\alpha$" $ \N{REPLACEMENT CHARACTER} \N{SNOWMAN}' in read.text


@pytest.mark.thorough
def test_a_very_long_name_is_whole_in_the_text_and_cut_only_beside_axes() -> None:
    long = "a very long name " * 30 + "end"
    html = odd_page(long)  # a figure squeezed by a name would be a warning, and so an error
    assert Page(html).text.count(long) >= 6
    durations = next(figure for figure in re.findall(r"<svg.*?</svg>", html, flags=re.DOTALL) if "bound" in figure)
    assert f"{long[:31]}\N{HORIZONTAL ELLIPSIS}" in durations


def test_the_page_says_what_the_values_say() -> None:
    text = Page(page()).text
    plan, design = case.plan(), case.design()
    for fact in (
        words.duration(plan.commands.duration_s),
        words.distance(plan.trajectory.distance_m),
        words.distance(plan.verification.clearance_min_m),
        words.percent(design.efficiency_repeats),
        words.percent(design.efficiency_uniform),
        f"bound {design.problem.dimension}",
        plan.area.depth_rule,
        plan.area.source,
        "expdesign run test-sound.toml",
        f"expdesign {__version__}",
    ):
        assert " ".join(fact.split()) in text
    assert text.count("reposition to ") == sum(leg.kind == "reposition" for leg in plan.legs)
    assert page().count('<tr class="run">') == len(primitive_runs(plan)) == sum(design.repeats)
    assert all(name in text for name in (*design.problem.names, *design.problem.parameters))


@pytest.mark.usefixtures("_no_figures")
def test_a_plan_that_is_not_verified_is_called_that() -> None:
    text = Page(report_html(case.report_content(plan=case.unverified()))).text
    assert "not verified: do not sail" in text
    assert "must not be sailed: the hull comes within 3.0 m of the rocks at 412 s" in text
    assert "\N{CHECK MARK} verified" not in text


@pytest.mark.parametrize("mean_subtraction", MEAN_SUBTRACTIONS)
def test_information_of_the_primitives_adds_up_to_that_of_the_design(mean_subtraction: str) -> None:
    names = case.tug().model.names
    problem = build_durations(case.scored(), names, total_s=480.0, mean_subtraction=mean_subtraction)
    design = solve_durations(problem)
    whole = np.tensordot(design.fractions, problem.matrices, axes=1)
    p = len(names)
    if mean_subtraction == "complete":
        whole = whole[:p, :p] - whole[:p, p:] @ whole[p:, :p]
    content = case.report_content(design=design)
    assert design.fractions @ information_rate(content) == pytest.approx(np.diag(whole), rel=1e-9)
    share = relative_information(content)
    assert share.max(axis=0) == pytest.approx(np.ones(p))
    assert share.min() >= -1e-12  # what tells nothing is zero but for rounding


def test_labels_keep_apart_and_inside_when_there_is_room() -> None:
    anchors = np.stack([np.linspace(45, 55, 12), np.full(12, 50.0)], axis=1)
    placed = place_labels(anchors, anchors, size=4.0, bounds=((0.0, 100.0), (0.0, 100.0)))
    apart = np.hypot(*(placed[:, None] - placed).transpose(2, 0, 1)) + 1e9 * np.eye(12)
    assert apart.min() >= 4.0
    assert placed.min() >= 2.0
    assert placed.max() <= 98.0


@pytest.mark.parametrize("ends", [(0.98, 1.01), (0.13, 0.47), (0.6, 2.9), (0.07, 8.0), (1e-7, 1e4)])
def test_logarithmic_axes_show_a_few_plain_numbers(ends: tuple[float, float]) -> None:
    axes = new_figure(8.0, 3.0).subplots()
    axes.set_xscale("log")
    axes.set_xlim(*ends)
    round_ticks(axes)
    shown = [float(label.get_text()) for label in axes.get_xticklabels()]
    assert 2 <= len(shown) <= 12
    assert shown == pytest.approx(list(axes.get_xticks()), rel=5e-3)
    assert len(axes.get_xticklabels(minor=True)) == 0


@pytest.mark.parametrize("span", [1e-4, 0.7, 1.0, 3.3, 47.0, 9.99e5])
def test_steps_are_round_and_few(span: float) -> None:
    step = nice_step(span, 6)
    assert span / step <= 6 + 1e-9
    assert round(step / 10 ** math.floor(math.log10(step) + 1e-9), 9) in (1.0, 2.0, 5.0)


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        (words.duration(45.25), "45.2 s"),
        (words.duration(59.7), "1 min"),
        (words.duration(200.0), "3 min 20 s"),
        (words.duration(3599.7), "1 h"),
        (words.duration(3899.0), "1 h 05 min"),
        (words.duration(4500.0), "1 h 15 min"),
        (words.clock(3661.4), "1:01:01"),
        (words.distance(38.41), "38.4 m"),
        (words.distance(999.6), "1 km"),
        (words.distance(6512.0), "6.51 km"),
        (words.speed(2.0), "2.00 m/s (3.9 kn)"),
        (words.number(-0.001), "0.00"),
        (words.number(-1.5, 1), "\N{MINUS SIGN}1.5"),
        (words.significant(0.00006), "0.00006"),
        (words.significant(0.0), "0"),
        (words.percent(0.9718), "97.2 %"),
        (words.percent(2.639), "264 %"),
        (words.percent(0.0004), "0.04 %"),
        (words.percent(0.0), "0 %"),
        (words.bearing(2 * math.pi - 1e-9), "000\N{DEGREE SIGN}"),
        (words.bearing(-math.pi / 2), "270\N{DEGREE SIGN}"),
        (words.latitude(60.1), "60\N{DEGREE SIGN}06.000\N{PRIME} N"),
        (words.latitude(-0.99999999), "01\N{DEGREE SIGN}00.000\N{PRIME} S"),
        (words.longitude(24.955), "024\N{DEGREE SIGN}57.300\N{PRIME} E"),
        (words.longitude(181.5), "178\N{DEGREE SIGN}30.000\N{PRIME} W"),
        (words.longitude(-70.5, 0), "070\N{DEGREE SIGN}30\N{PRIME} W"),
        (words.current(np.array([0.1, 0.0]), 0.0), "0.10 m/s (0.2 kn) setting 000\N{DEGREE SIGN} (north)"),
        (words.wind(np.array([0.0, -5.0]), 0.0), "5.00 m/s (9.7 kn) from 090\N{DEGREE SIGN} (east)"),
        (words.wind(np.zeros(2), 0.0), "no mean wind"),
    ],
)
def test_numbers_are_said_as_people_say_them(said: str, wanted: str) -> None:
    assert said.replace("\N{NO-BREAK SPACE}", " ") == wanted


def noisy_content() -> object:
    """The case with sensors that have noise and with its route."""
    vessel = replace(case.tug(), sensors=Sensors(velocity_mps=0.01, yaw_rate_radps=0.001))
    route = build_route(case.planned(), safe_water=case.plan().area.water)
    return case.report_content(vessel=vessel, route=route)


def read_number(text: str) -> float:
    """3.1·10⁻⁴ or 0.0032."""
    digits, _, power = text.partition("·10")
    raised = str.maketrans({"⁻": "-"} | {chr(sign): str(n) for n, sign in enumerate(
        (0x2070, 0xB9, 0xB2, 0xB3, *range(0x2074, 0x207A)))})  # fmt: skip
    return float(digits) * 10.0 ** int(power.translate(raised) or 0)


def test_uncertainties_are_those_of_the_whole_track_and_of_the_runs() -> None:
    content = noisy_content()
    found = content.accuracy
    part = TrialPart(commands=content.plan.commands, velocity=np.zeros(3), heading_rad=0.0)
    forecast = content.environment
    unknown = forecast.current_std_mps > 0
    covariance = expected_covariance(
        content.vessel, [part], content.parameters, environment=forecast, unknown_current=unknown
    )
    assert found.track == pytest.approx(np.sqrt(np.diag(covariance)))
    assert np.array_equal(found.before, content.parameter_std)
    assert (found.runs >= 0.999 * found.track).all()  # more data never tell less
    rows = parameter_rows(content, found)
    assert [read_number(row[5]) for row in rows] == pytest.approx(found.track, rel=0.051)


@pytest.mark.usefixtures("_no_figures")
@pytest.mark.parametrize("known", [1e-9, 1e9])
def test_what_was_known_better_before_is_said_to_be_not_lost(known: float) -> None:
    content = noisy_content()
    model = replace(content.vessel.model, parameter_std=np.full(len(content.vessel.model.names), known))
    told = Page(report_html(replace(content, vessel=replace(content.vessel, model=model)))).text
    assert ("The prior knowledge is not lost" in told) == (known < 1.0)


@pytest.mark.usefixtures("_no_figures")
@pytest.mark.parametrize("std_mps", [0.0, 0.15])
def test_a_steady_current_that_nobody_knows_is_said_to_be_estimated_with_the_parameters(std_mps: float) -> None:
    content = noisy_content()
    forecast = replace(content.environment, current_std_mps=std_mps)
    told = Page(report_html(replace(content, environment=forecast))).text
    assert ("hold where it is estimated with the parameters" in told) == (std_mps > 0)


def growth_of(name: str) -> Growth:
    """Two additions; the numbers are only to be found again."""
    rounds = tuple(
        GrowRound(
            name=name, family="steps", settings={"speed_mps": 1.5, "duration_s": 60.0}, sensitivity=20.25 - number,
            searched=20.0, log_det_gain=2.125, efficiency=1.25 + number, excitation_condition=number == 0,
        )
        for number in range(2)
    )  # fmt: skip
    limits = np.array([[0.0, 3.0], [-0.5, 0.5], [-0.1, 0.1]])
    return Growth(
        specs=(), information=case.scored(), rounds=rounds, limits=limits, evaluated=321, dimension=13, parameters=10,
        best_left=13.5,
    )  # fmt: skip


@pytest.mark.usefixtures("_no_figures")
def test_additions_to_the_dictionary_are_reported_with_their_gain() -> None:
    told = Page(report_html(case.report_content(growth=growth_of("found-1")))).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "1 found-1 steps; speed 1.5 m/s (2.9 kn), duration 60 s holds 20.25 +2.125 125 %" in told
    assert "2 found-1 steps; speed 1.5 m/s (2.9 kn), duration 60 s does not hold 19.25 +2.125 225 %" in told
    assert "The search evaluated 321 candidates, with u from 0.00 to 3.00 m/s" in told
    assert f"at least {100 * math.exp(-0.05):.1f} % among all evaluated candidates" in told
    assert "Manoeuvres added by the search" not in report_html(case.report_content())
    empty = Page(report_html(case.report_content(growth=replace(growth_of("x"), rounds=())))).text
    assert "The search found no manoeuvre that improves the design." in empty
    assert "<script>" not in report_html(case.report_content(growth=growth_of(ODD)))


@pytest.mark.usefixtures("_no_figures")
@pytest.mark.parametrize("deep", [True, False])
def test_a_chart_without_depths_is_called_that_before_anything_else(deep: bool) -> None:
    area = case.plan().area
    charted = replace(area, depths=((10.0, area.water),) if deep else ())
    told = Page(report_html(case.report_content(plan=replace(case.plan(), area=charted)))).text
    assert ("No depths were checked" not in told) is deep
    assert ("depths not checked" not in told.partition("What may go wrong")[0]) is deep


def test_the_chain_of_proofs_ends_at_the_route_that_was_written() -> None:
    content = noisy_content()
    links = chain(content, short_of_optimum="0.1 %")
    steps = [link[0] for link in links]
    assert steps == ["Optimal durations", "Whole runs", "Whole track", "Allowed water", "Exported route"]
    assert words.number(content.route.xtd_m) in links[-1][1]
    assert "every leg in allowed water" in links[-1][1]
    assert (
        "NOT"
        in chain(
            replace(content, route=replace(content.route, fit=replace(content.route.fit, in_water=False))),
            short_of_optimum="",
        )[-1][1]
    )


def test_the_least_charted_depth_is_that_of_the_shallowest_water_under_the_track() -> None:
    area, points = case.plan().area, np.array([[0.0, 0.0], [0.0, 50.0], [0.0, 90.0]])
    deep = shapely.MultiPolygon([shapely.box(-10, -10, 100, 10)])
    deeper = shapely.MultiPolygon([shapely.box(-10, -10, 60, 10)])
    charted = replace(area, depths=((5.0, deep), (20.0, deeper)))
    assert least_charted_depth(charted, points) == 5.0
    assert least_charted_depth(charted, points[:2]) == 20.0
    assert least_charted_depth(charted, np.array([[0.0, 200.0]])) is None
    assert least_charted_depth(area, points) is None


def test_footprints_hold_the_planned_hull_and_grow_with_what_is_unknown() -> None:
    content = case.report_content()
    known = replace(content, vessel=replace(content.vessel, model=replace(
        content.vessel.model, parameter_std=np.zeros(len(content.parameters)))), environment=CALM)  # fmt: skip
    legs = [leg for leg in content.plan.legs if leg.kind == "primitive"]
    for leg, wide, tight in zip(legs, footprints(content), footprints(known), strict=True):
        pose = content.plan.trajectory.pose[[leg.first, leg.last]]
        assert all(wide.buffer(0.1).covers(hull) for hull in hull_polygons(pose, content.vessel.hull_b))
        assert wide.area > tight.area


def test_every_stacked_cell_says_what_it_is_as_the_head_of_its_column_would() -> None:
    """On a narrow screen the head of a stacked table is hidden and each cell names its column."""
    tables = [table for table in lxml_html.fromstring(page()).iter("table") if "stack" in (table.get("class") or "")]
    assert len(tables) >= 4
    for table in tables:
        heads = [cell.text_content().strip() for cell in table.find("thead").iter("th")]
        for row in table.find("tbody").iter("tr"):
            named = [cell.get("data-label") for cell in row]
            assert all(named)
            if len(named) == len(heads):
                assert [name for name, head in zip(named, heads, strict=True) if head] == [*filter(None, heads)]


def test_the_chart_comes_first_and_beside_it_what_to_book_and_what_may_go_wrong() -> None:
    content = case.report_content()
    first, _, rest = page().partition("<nav>")
    told = Page(first).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "<svg" in first
    assert "</svg>" not in rest[: rest.index("<h2>Agenda</h2>")]
    for index, leg in enumerate(content.plan.legs):  # under the pointer, the name and the duration of each
        (title,) = re.findall(rf'<g id="chart-leg-{index}"><title>(.*?)</title>', first)
        assert content.shown(leg.name) in title
    assert "Book " in told if content.plan.risk else "As planned" in told
    assert "What may go wrong" in told


def test_what_is_booked_is_enough_in_most_simulated_trials() -> None:
    plan = case.plan()
    planned_s = plan.day.planned_s
    risk = SimpleNamespace(extra_median_s=0.1 * planned_s, extra_most_s=0.4 * planned_s)
    assert report_page.booking(replace(plan, risk=risk)).value == words.duration(1.4 * planned_s)
    assert report_page.booking(replace(plan, risk=None)).name == "As planned"


@pytest.mark.parametrize("width_in", [3.6, 6.4])
def test_positions_beside_a_chart_of_any_shape_are_whole(width_in: float) -> None:
    """That nothing is cut is asserted of every figure that tests draw, in `conftest`."""
    content = case.report_content()
    for height in np.linspace(600.0, 1600.0, 11):
        box = (-500.0, -height / 2, 500.0, height / 2)
        with report_style():
            figure, axes = sea_figure(content.plan.area, box, width_in, clearance_m=5.0, vessel=content.vessel)
            draw_position_ticks(axes, content.plan.area.frame, box)
            svg(figure, key="shape", label="shape")


def test_zones_are_named_on_the_chart() -> None:
    content = case.report_content()
    north, east = content.plan.trajectory.pose[0, :2]
    zones = {"Firing range": 60.0, "Fish farm": 5.0}
    named = tuple(
        (name, shapely.MultiPolygon([shapely.Point(east, north).buffer(size)])) for name, size in zones.items()
    )
    area = replace(content.plan.area, named=named)
    drawn = chart(replace(content, plan=replace(content.plan, area=area)))
    assert all(name in drawn for name in zones)
