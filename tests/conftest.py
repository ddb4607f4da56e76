"""Options of the whole suite."""

from __future__ import annotations

import fcntl
import gc
import json
import os
import shutil
import signal
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

# Workers share the processors already; threads of linear algebra would only wait for each other.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# They take both cores already: commands without --jobs start no processes of their own.
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")
# Results must come from the code that is tested, not from the cache of whoever runs the tests.
os.environ["EXPDESIGN_CACHE"] = "off"
# Compiled modules are kept: else workers and every program that a test starts compile the package anew.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# A shell starts background jobs with SIGINT ignored, and what they start inherits that.
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--no-skips", action="store_true", help="a test or file that skips fails: nothing may be missing")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whole trials, which take longest, come first, so that no worker is left with one at the end."""
    items.sort(key=lambda item: "made_once" not in getattr(item, "fixturenames", ()))


def pytest_collection_finish() -> None:
    """Cycles of garbage are looked for more rarely, and not among modules and tests."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


def pytest_unconfigure() -> None:
    """What is left is given back, of which some libraries else say that it leaks."""
    gc.unfreeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    return _counted(item.config, (yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    return _counted(collector.config, (yield))


@pytest.fixture(scope="session")
def browser():
    """Chromium without a screen."""
    from playwright.sync_api import sync_playwright

    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    assert chromium, "no Chromium is installed"
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture(scope="session")
def made_once(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[str, Callable[[Path], object]], tuple[Path, object]]:
    """Results made once in a run of the tests, by the worker that needs them first.

    Call it with a name and a function that fills a new folder; it gives the folder and the function's answer, as JSON
    keeps it.
    """
    root = tmp_path_factory.getbasetemp()
    root = (root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / "made-once"
    root.mkdir(exist_ok=True)

    def made(name: str, make: Callable[[Path], object]) -> tuple[Path, object]:
        folder, answer = root / name, root / f"{name}.json"
        with (root / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not answer.exists():
                assert not folder.exists(), f"{name} could not be made before"
                folder.mkdir()
                content = json.dumps(make(folder))
                answer.write_text(content, encoding="utf-8")
        return folder, json.loads(answer.read_text(encoding="utf-8"))

    return made


def _counted(config: pytest.Config, report):
    """The report, a skip turned into a failure where skips are not allowed."""
    if config.getoption("--no-skips") and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome, report.longrepr = "failed", f"skipped, which --no-skips forbids: {report.longrepr}"
    return report


@pytest.fixture(scope="session", autouse=True)
def labels_are_whole() -> Generator[None]:
    """Every figure that any test draws has all its text inside the picture: none is cut in a page."""
    from matplotlib.backends.backend_svg import RendererSVG

    draw = RendererSVG.draw_text

    def checked(self, gc, x, y, s, prop, angle, ismath=False, mtext=None):
        if mtext is not None and s.strip():
            x0, y0, x1, y1 = mtext.get_window_extent(self).extents
            assert min(x0, y0, self.width - x1, self.height - y1) > -1.0, f"{s!r} is cut"
        draw(self, gc, x, y, s, prop, angle, ismath=ismath, mtext=mtext)

    RendererSVG.draw_text = checked
    yield
    RendererSVG.draw_text = draw


@pytest.fixture(scope="module")
def undrawn() -> Generator[None]:
    """Figures of pages stay empty, for tests of numbers: other tests draw each kind of page."""
    with _without_figures():
        yield


@pytest.fixture
def undrawn_here() -> Generator[None]:
    """The same for one test of a file in which others look at figures."""
    with _without_figures():
        yield


@contextmanager
def _without_figures() -> Generator[None]:
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    def empty(self, target, **options) -> None:
        target.write('<svg viewBox="0 0 1 1" width="1" height="1"></svg>')

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FigureCanvasSVG, "print_svg", empty)
        yield
