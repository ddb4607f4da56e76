"""Does the page stay smooth: eight hours of plan as they are played, a chart of 30,000 corners, the first screen.

``python tests/benchmarks/page_speed.py``: a browser without a screen, 1366 by 900 pixels. The plan is that of the small
craft, there and back until eight hours are full; the chart has 300 islets of 100 corners around her bay. Times between
frames are divided by those of the same page left alone; an empty page stands beside the first screen.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from expdesign.cli import main

HOURS, SPEEDS, FRAMES = 8.0, (1, 10, 100), 120
ISLETS, CORNERS, LAT, LON = 300, 100, 58.0, 11.0
BETWEEN = """n => new Promise(done => {
    const all = []; let last = performance.now();
    requestAnimationFrame(function next(now) {
        all.push(now - last); last = now;
        all.length < n ? requestAnimationFrame(next) : done(all.slice(2));
    });
})"""


def repeated(plan: Path, out: Path) -> None:
    """The plan there and back, until the hours are full."""
    out.mkdir()
    content = json.loads((plan / "plan.json").read_text())
    header, *_ = (plan / "track.csv").read_text().splitlines()
    track, orders = (np.loadtxt(plan / name, delimiter=",", skiprows=1) for name in ("track.csv", "commands.csv"))
    legs, leg = len(content["legs"]), header.split(",").index("leg")
    lasts_s = track[-1, 0] + track[1, 0]
    times = int(np.ceil(HOURS * 3600.0 / lasts_s))
    rows = []
    for number in range(times):
        part = (track if number % 2 == 0 else track[::-1]).copy()
        part[:, 0] = track[:, 0] + number * lasts_s
        part[:, leg] = (part[:, leg] if number % 2 == 0 else legs - 1 - part[:, leg]) + number * legs
        rows.append(part)
    content["legs"] = [one for number in range(times) for one in content["legs"][:: 1 if number % 2 == 0 else -1]]
    all_orders = np.tile(orders, (times, 1))
    all_orders[:, 0] = np.arange(len(all_orders)) * orders[1, 0]
    words = (plan / "commands.csv").read_text().splitlines()[0]
    for name, head, table in (("track.csv", header, np.vstack(rows)), ("commands.csv", words, all_orders)):
        np.savetxt(out / name, table, delimiter=",", header=head, comments="", fmt="%.8f")
    (out / "plan.json").write_text(json.dumps(content))
    shutil.copy(plan / "dictionary.json", out)


def islets(area: Path) -> None:
    """Add islets of many corners to the chart, away from the bay's middle."""
    chart = area.with_name("area.geojson")
    content, angles = json.loads(chart.read_text()), np.linspace(0.0, 2.0 * np.pi, CORNERS)
    for number in range(ISLETS):
        turn, far = 2.399963 * number, 1.5e-3 + 2e-5 * number  # the golden angle spreads them
        ring = [
            [LON + far * np.cos(turn) / 0.53 + 4e-5 * np.cos(a), LAT + far * np.sin(turn) + 2e-5 * np.sin(a)]
            for a in angles
        ]
        content["features"].append(
            {"type": "Feature", "properties": {"layer": "land"}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        )
    chart.write_text(json.dumps(content))
    text = area.read_text()
    bounds = {"south": LAT - 0.009, "west": LON - 0.017, "north": LAT + 0.009, "east": LON + 0.017}
    kept = re.sub(r"\[bounds\][^\[]*", "", text)
    area.write_text(kept + "\n[bounds]\n" + "".join(f"{side}_deg = {value}\n" for side, value in bounds.items()))


def frames(page: Page) -> np.ndarray:
    return np.array(page.evaluate(BETWEEN, FRAMES))


def row(what: str, found: np.ndarray, alone: np.ndarray) -> None:
    ratio, late = np.median(found) / np.median(alone), np.mean(found > 2.5 * np.median(alone))
    print(f"| {what} | {np.median(found):.0f} ms | {ratio:.2f} | {found.max():.0f} ms | {late:.1%} |", flush=True)


def measure(page: Page, address: str) -> None:
    began = time.monotonic()
    page.goto(f"{address}/licence-of-nothing")
    empty_s = time.monotonic() - began
    began = time.monotonic()
    page.goto(f"{address}/sea?scenario=craft/scenario.toml")
    corners = int(page.wait_for_selector("[data-drawn]").get_attribute("data-drawn"))
    first_s = time.monotonic() - began
    print(f"First screen, a chart of {corners} corners: {first_s:.1f} s; an empty page {empty_s:.2f} s.\n")
    print(
        "| what | between frames | over the page alone | longest | more than two frames late |\n|---|---|---|---|---|"
    )
    page.wait_for_timeout(1000)
    alone = frames(page)
    row("the chart, alone", alone, alone)
    box = page.locator(".chart").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.evaluate(f"window.found = ({BETWEEN})({FRAMES})")
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(60):
        page.mouse.move(x + 4 * step, y + 2 * step)
    page.mouse.up()
    row("the chart, panned", np.array(page.evaluate("window.found")), alone)
    page.goto(f"{address}/plan?scenario=craft/scenario.toml&plan=runs/eight/plan.json")
    page.wait_for_selector("[data-drawn]")
    page.wait_for_timeout(4000)
    alone = frames(page)
    row("the plan, alone", alone, alone)
    for speed in SPEEDS:
        page.get_by_label("Speed").first.click()
        page.get_by_role("option", name=str(speed), exact=True).click()
        page.get_by_role("button", name="Play").click()
        page.wait_for_timeout(500)
        row(f"the plan, played at {speed} times", frames(page), alone)
        page.get_by_role("button", name="Pause").click()


def benchmark() -> None:
    os.chdir(tempfile.mkdtemp())
    assert main(["new", "craft", "--kind", "asv", "--quiet"]) == 0
    assert main(["run", "craft/scenario.toml", "--out", "runs/craft", "--quiet"]) == 0
    repeated(Path("runs/craft"), Path("runs/eight"))
    islets(Path("craft/area.toml"))
    words = [sys.executable, "-m", "expdesign", "web", ".", "--port", "0", "--no-browser"]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
    ) as server:
        address = re.search(r"http://\S+", server.stdout.readline())[0].rstrip("/")
        with sync_playwright() as playwright:
            chromium = shutil.which("chromium") or shutil.which("google-chrome")
            browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1366, "height": 900})
            page.set_default_timeout(120_000)
            measure(page, address)
            browser.close()
        server.terminate()


if __name__ == "__main__":
    benchmark()
