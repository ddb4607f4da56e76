"""The page in a real browser, off line: draw an area, switch manoeuvres, plan, stop, compare, import, diagnose."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from expdesign.web.folder import MOST_UPLOAD_BYTES
from scenario_files import SCENARIOS

pytestmark = pytest.mark.browser

LONG_MS = 180_000
WIDTHS = (768, 1366)
SCREENS = ("", "sea", "ship", "manoeuvres", "plan", "whatif", "data", "files")


def started(folder: Path, *options: str) -> tuple[subprocess.Popen[str], str]:
    """The server of a folder and its address."""
    words = [sys.executable, "-m", "expdesign", "web", str(folder), "--port", "0", "--no-browser", *options]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    found = re.search(r"http://\S+", server.stdout.readline())
    return server, found[0]


def ended(server: subprocess.Popen[str]) -> int:
    with server:  # closes its output
        server.send_signal(signal.SIGINT)
        return server.wait(timeout=30)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    from expdesign.cli import main

    root = tmp_path / "work"
    root.mkdir()
    before = Path.cwd()
    os.chdir(root)
    try:
        assert main(["new", "craft", "--kind", "asv", "--quiet"]) == 0
    finally:
        os.chdir(before)
    return root


@pytest.fixture
def address(folder: Path) -> Iterator[str]:
    server, where = started(folder)
    yield where
    assert ended(server) == 0


@pytest.fixture
def page(browser, address: str):
    """A page that fails on errors of scripts and on requests that leave the machine."""
    context = browser.new_context(viewport={"width": 1366, "height": 900}, base_url=address)
    wrong = []

    def own(route, request) -> None:
        if request.url.startswith((address, "data:", "blob:")):
            route.continue_()
        else:
            wrong.append(f"asks {request.url}")
            route.abort()

    context.route("**/*", own)
    found = context.new_page()
    found.set_default_timeout(LONG_MS)
    found.on("pageerror", lambda error: wrong.append(str(error)))
    yield found
    context.close()
    assert not wrong


def chart(page):
    page.wait_for_selector("[data-drawn]")
    return page.locator(".chart").bounding_box()


def tables(path: Path) -> dict:
    return tomllib.loads(path.read_text(encoding="utf-8"))


def eventually(page, claim, what: str) -> None:
    """Wait for what files or the page must come to."""
    for _ in range(LONG_MS // 200):
        if claim():
            return
        page.wait_for_timeout(200)
    raise AssertionError(what)


def draw_zone(page, box, press) -> None:
    """A square by its corners and the first one again, each pressed when the chart has taken the one before."""
    page.locator(".leaflet-draw-tooltip").first.wait_for()  # the chart is ready to draw
    corners = [(0.45, 0.2), (0.6, 0.2), (0.6, 0.35), (0.45, 0.35)]
    taken = page.locator(".leaflet-editing-icon")
    for count, (right, down) in enumerate([*corners, corners[0]]):
        eventually(page, lambda count=count: taken.count() == count, f"the chart has {count} corners")
        page.wait_for_timeout(300)  # two presses in short sequence are a double click
        press(box["x"] + right * box["width"], box["y"] + down * box["height"])


def drag(page, title: str, east_px: float, north_px: float) -> None:
    mark = page.get_by_title(title, exact=True).bounding_box()
    x, y = mark["x"] + mark["width"] / 2, mark["y"] + mark["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + east_px, y - north_px, steps=6)
    page.mouse.up()


def test_a_zone_is_drawn_named_and_undone_and_the_start_is_moved_and_turned(page, folder: Path) -> None:
    area, scenario = folder / "craft/area.toml", folder / "craft/scenario.toml"
    comments = [line for line in area.read_text().splitlines() if line.startswith("#")]
    page.goto("/sea")
    box = chart(page)
    page.get_by_text("can be planned in").wait_for()
    page.get_by_role("button", name="Draw a no-go zone").click()

    def press(x: float, y: float) -> None:
        page.mouse.move(x, y)
        page.wait_for_timeout(100)
        page.mouse.down()
        page.mouse.up()

    draw_zone(page, box, press)
    eventually(page, lambda: "no_go" in tables(area), "the zone is in the area file")
    page.get_by_text("+ [[no_go]]").wait_for()
    polygon = tables(area)["no_go"][0]["polygon"]
    assert len(polygon) == 4
    assert all(57 < lat < 59 and 10 < lon < 12 for lat, lon in polygon)
    assert [line for line in area.read_text().splitlines() if line.startswith("#")] == comments
    name = page.get_by_label("Zone 1")
    name.fill("Fish farm")
    name.blur()
    eventually(page, lambda: tables(area)["no_go"][0]["name"] == "Fish farm", "the zone has its name")

    before = page.get_by_title("start", exact=True).bounding_box()
    drag(page, "start", 40.0, 30.0)
    eventually(page, lambda: "lat_deg" in tables(scenario)["start"], "the start is moved")
    moved = tables(scenario)["start"]
    assert "north_m" not in moved
    assert moved["lat_deg"] > 57.9999
    assert page.get_by_title("start", exact=True).bounding_box() != before
    drag(page, "heading of the start", -60.0, -60.0)
    eventually(page, lambda: tables(scenario)["start"]["heading_deg"] != moved["heading_deg"], "the start is turned")
    drag(page, "start", -400.0, 0.0)
    page.locator(".clear.wrong").wait_for()
    page.locator(".wrong", has_text="start").first.wait_for()

    for _ in range(5):  # three of the start, the name, the zone
        count = len(list(folder.joinpath(".expdesign").rglob("0*")))
        page.get_by_role("button", name="Undo").click()
        eventually(page, lambda before=count: len(list(folder.joinpath(".expdesign").rglob("0*"))) < before, "undone")
    assert "no_go" not in tables(area)
    assert "north_m" in tables(scenario)["start"]


def test_a_finger_draws_a_zone_and_then_moves_the_start(browser, address: str, folder: Path) -> None:
    area, scenario = folder / "craft/area.toml", folder / "craft/scenario.toml"
    context = browser.new_context(viewport={"width": 768, "height": 1024}, base_url=address, has_touch=True)
    tablet = context.new_page()
    tablet.goto("/sea")
    box = chart(tablet)
    tablet.get_by_role("button", name="Draw a no-go zone").tap()
    draw_zone(tablet, box, tablet.touchscreen.tap)
    eventually(tablet, lambda: "no_go" in tables(area), "the zone is in the area file")
    tablet.wait_for_timeout(500)
    finger = context.new_cdp_session(tablet)
    mark = tablet.get_by_title("start", exact=True).bounding_box()
    for step in range(9):
        at = {"x": mark["x"] + 14 + 4 * step, "y": mark["y"] + 14 - 3 * step}
        kind = "touchMove" if step else "touchStart"
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [at]})
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    eventually(tablet, lambda: "lat_deg" in tables(scenario)["start"], "the start is moved")
    moved = tablet.get_by_title("start", exact=True).bounding_box()
    assert (moved["x"] - mark["x"], moved["y"] - mark["y"]) == pytest.approx((32.0, -24.0), abs=2.0)
    context.close()


def test_manoeuvres_answer_within_a_second_and_stay_in_the_file(page, folder: Path) -> None:
    scenario = folder / "craft/scenario.toml"
    page.goto("/manoeuvres")
    page.locator(".run svg").first.wait_for()
    page.get_by_text("Certificate").wait_for()
    page.locator(".run").first.get_by_role("checkbox").click()
    eventually(page, lambda: tables(scenario)["design"].get("excluded"), "a manoeuvre is taken out")
    page.get_by_text("Certificate").wait_for()
    page.get_by_text("Criterion, accuracy or time").click()
    total = page.get_by_label("total_s")
    total.fill("-5")
    total.blur()
    page.locator(".wrong", has_text="more than 0").wait_for()
    assert tables(scenario)["design"]["total_s"] == 120.0
    total.fill("90")
    total.blur()
    eventually(page, lambda: tables(scenario)["design"]["total_s"] == 90, "the time is written")


def test_actuators_and_parameters_of_the_ship_are_fields_that_refuse_what_is_wrong(page, folder: Path) -> None:
    vessel = folder / "craft/vessel.toml"
    first = tables(vessel)
    page.goto("/ship")
    page.get_by_text("[[actuators]] 1: ").click()
    place = page.get_by_label("forward_m").first
    for value, claim in (("9000", "counted from amidships"), ("0.25", "")):
        place.fill(value)
        place.blur()
        if claim:
            page.locator(".wrong", has_text=claim).wait_for()
            assert tables(vessel) == first
    eventually(page, lambda: tables(vessel)["actuators"][0]["forward_m"] == 0.25, "the place is written")
    page.get_by_text("[model]", exact=True).click()
    page.get_by_text("[model.parameters]", exact=True).click()
    name = next(iter(first["model"]["parameters"]))
    page.get_by_label(name, exact=True).first.fill("-0.5")
    page.get_by_label(name, exact=True).first.blur()
    eventually(page, lambda: tables(vessel)["model"]["parameters"][name] == -0.5, "the parameter is written")


def test_a_plan_is_made_stopped_reloaded_and_played(page, folder: Path) -> None:
    page.goto("/plan")
    chart(page)
    page.get_by_role("button", name="Plan the trial").click()
    page.get_by_role("button", name="Stop").wait_for()
    page.reload()
    page.get_by_role("button", name="Stop").click()
    page.get_by_text("stopped, nothing half-written").wait_for()
    assert not (folder / "runs/craft/plan.json").exists()

    page.get_by_role("button", name="Plan the trial").click()
    page.get_by_text("Verified", exact=True).wait_for()
    assert json.loads((folder / "runs/craft/plan.json").read_text())["verified"] is True
    assert (folder / "runs/craft/route.rtz").exists()
    page.get_by_text("expdesign run craft/scenario.toml").first.wait_for()
    page.get_by_role("button", name="Play").click()
    page.locator(".now dd", has_text=re.compile("0:00:0[1-9]")).first.wait_for()
    page.get_by_role("button", name="Pause").click()
    page.get_by_label("Time of the plan").fill("100")
    page.locator(".now dd", has_text="0:01:40").wait_for()
    with page.expect_download() as download:
        page.get_by_role("link", name="route.rtz").click()
    assert "<route" in Path(download.value.path()).read_text()


def test_a_draft_is_drawn_on_the_chart(page, folder: Path) -> None:
    page.goto("/plan")
    chart(page)
    page.get_by_role("button", name="Draft", exact=True).click()
    page.get_by_text("A draft is drawn on the chart").wait_for()
    legs = json.loads((folder / "runs/craft-draft/plan.json").read_text())["legs"]
    page.wait_for_selector(f"[data-sketched='{len(legs)}']")


def test_variants_are_compared_and_a_page_that_is_older_says_so(page, folder: Path) -> None:
    (folder / "craft/longer.toml").write_text("[design]\ntotal_s = 240.0\n")
    page.goto("/whatif")
    page.get_by_text("design.total_s = 240 instead of 120").wait_for()
    page.get_by_role("checkbox", name="craft/longer.toml").click()
    page.get_by_role("button", name="Compare", exact=True).click()
    page.frame_locator("iframe").get_by_text("longer").first.wait_for()
    other = page.context.new_page()
    other.goto("/files?file=craft/scenario.toml")
    (folder / "craft/scenario.toml").write_text(
        (folder / "craft/scenario.toml").read_text() + "\n# changed elsewhere\n"
    )
    for tab in (page, other):
        tab.get_by_text("craft/scenario.toml changed elsewhere").wait_for()
    other.get_by_role("button", name="Load again").click()
    other.get_by_text("# changed elsewhere").wait_for()


def test_a_log_is_dropped_imported_and_diagnosed(page, folder: Path) -> None:
    log = SCENARIOS / "logs/bridge.csv"
    shutil.copy(SCENARIOS / "vessels/logged-50m.toml", folder / "craft")
    page.goto("/data")
    page.get_by_label("Vessel file").click()
    page.get_by_role("option", name="craft/logged-50m.toml").click()
    page.locator("input[type=file]").set_input_files(str(log))
    eventually(page, lambda: (folder / "logs" / log.name).exists(), "the log is in the folder")
    page.get_by_role("button", name="Import").click()
    page.frame_locator("iframe").locator("h1").first.wait_for()
    page.get_by_role("button", name="Diagnose").click()
    page.get_by_text(re.compile("expdesign diagnose")).first.wait_for()
    eventually(page, lambda: list(folder.glob("runs/*-diagnose/diagnosis.json")), "the data are diagnosed")
    page.frame_locator("iframe").last.locator("h1").first.wait_for()
    page.get_by_role("button", name="Trial result").click()
    page.get_by_text("plan the scenario's trial, choose its runs and estimate from them first").wait_for()


def test_what_is_wrong_in_a_file_is_said_in_the_page(page, folder: Path) -> None:
    scenario = folder / "craft/scenario.toml"
    scenario.write_text(scenario.read_text().replace('vessel = "vessel.toml"', 'vessel = "../../elsewhere.toml"'))
    for screen in ("sea", "ship", "plan", "data"):
        page.goto(f"/{screen}")
        page.locator(".wrong", has_text="elsewhere.toml").first.wait_for()


def test_what_cannot_be_written_is_said_on_every_page(page, folder: Path) -> None:
    first = {path: path.read_text() for path in folder.rglob("*.toml")}
    for name in (".expdesign", "logs"):
        (folder / name).write_text("a file where a folder is needed")
    told = page.locator(".q-notification", has_text="cannot be written")

    page.goto("/sea")
    page.get_by_text("Start, goal and plan as numbers").click()
    page.get_by_text("[plan]", exact=True).click()
    clearance = page.get_by_label("clearance_m").first
    clearance.fill("7")
    clearance.blur()
    page.locator(".wrong", has_text="cannot be written").wait_for()

    page.goto("/files?file=craft/scenario.toml")
    page.locator(".cm-content").click()
    page.keyboard.type("# more\n")
    page.get_by_role("button", name="Write").click()
    told.wait_for()

    page.goto("/manoeuvres")
    page.locator(".run").first.get_by_role("checkbox").click()
    told.wait_for()

    page.goto("/data")
    page.locator("input[type=file]").set_input_files(str(SCENARIOS / "logs/bridge.csv"))
    told.wait_for()
    assert {path: path.read_text() for path in folder.rglob("*.toml")} == first


def test_a_file_that_is_too_large_is_told(page, folder: Path, tmp_path: Path) -> None:
    large = tmp_path / "day.csv"
    with large.open("wb") as file:
        file.truncate(MOST_UPLOAD_BYTES + 1)  # takes no room
    for screen, beside in (("data", "logs"), ("sea", "craft")):
        page.goto(f"/{screen}")
        page.locator("input[type=file]").set_input_files(str(large))
        page.locator(".q-notification", has_text=f"copy it into {folder / beside}").wait_for()


CONTRASTS = """() => {
    const parts = (colour) => colour.match(/[\\d.]+/g).map((x) => (colour.startsWith("color(") ? 255 : 1) * x);
    const light = (colour) => parts(colour).slice(0, 3).map((x) => x / 255)
        .map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4))
        .reduce((sum, x, k) => sum + x * [0.2126, 0.7152, 0.0722][k], 0);
    const behind = (e) => { for (; e; e = e.parentElement) {
        const colour = getComputedStyle(e).backgroundColor;
        if (parts(colour)[3] !== 0) return colour; } return "rgb(255, 255, 255)"; };
    return [...document.querySelectorAll("button, a, .quiet, .wrong, .good, .help")]
        .filter((e) => e.checkVisibility() && e.innerText && !e.closest(".leaflet-control, .unused"))
        .map((e) => { const [a, b] = [light(getComputedStyle(e).color), light(behind(e))].sort((x, y) => y - x);
            return [e.innerText, (a + 0.05) / (b + 0.05)]; })
        .filter(([, ratio]) => ratio < 4.5); }"""
"""Words with less contrast to what is behind them than WCAG 2.1 asks for, section 1.4.3."""


def test_words_have_contrast_by_day_and_by_night(page) -> None:
    for _ in ("day", "night"):
        for screen in SCREENS:
            page.goto(f"/{screen}")
            page.locator("nav .here").wait_for()
            page.wait_for_timeout(500)
            assert not page.evaluate(CONTRASTS), screen
        page.get_by_role("button", name="Night").click()
        page.wait_for_timeout(300)


@pytest.mark.parametrize("width", WIDTHS)
def test_no_screen_is_wider_than_its_window(page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    for screen in SCREENS:
        page.goto(f"/{screen}")
        page.locator("nav .here").wait_for()
        page.wait_for_timeout(500)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, screen
        unnamed = page.evaluate(
            "[...document.querySelectorAll('button, input, select, textarea, [role=checkbox], [role=button]')]"
            ".filter(e =>"
            " e.checkVisibility() && !(e.innerText || e.ariaLabel || e.title || e.labels?.length || e.type == 'file' ||"
            " e.closest('label') || e.closest('.q-uploader'))).map(e => e.outerHTML.slice(0, 120))"
        )
        assert not unnamed, screen
