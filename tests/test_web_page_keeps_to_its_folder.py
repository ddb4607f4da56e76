"""The page reads and writes one folder, lets in who may, keeps versions, and makes forms of what reads the files."""

import asyncio
import errno
import os
import re
from pathlib import Path

import pytest

from expdesign import requests
from expdesign.errors import InputError
from expdesign.plan.values import PlanSettings
from expdesign.scenario import load_scenario
from expdesign.scenario.scenario_file import ScenarioFile
from expdesign.web.answers import change_in, clearance_of, durations_of, ends_of, problem_of
from expdesign.web.folder import MOST_VERSIONS, Folder
from expdesign.web.forms import put
from expdesign.web.jobs import Job, Jobs
from expdesign.web.server import Gate
from expdesign.workflows import new

OUTSIDE = ("../secret", "/etc/passwd", "a/../../secret", ".expdesign/a/000001", "link/secret")


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    root = tmp_path / "root"
    root.mkdir()
    (tmp_path / "secret").write_text("secret")
    (root / "link").symlink_to(tmp_path)
    return Folder(root.resolve())


@pytest.mark.parametrize("name", OUTSIDE)
def test_nothing_outside_the_folder_is_read_or_written(folder: Folder, name: str) -> None:
    for act in (folder.path, folder.versions, folder.undo, lambda at: folder.write(at, "x"), folder.digest):
        with pytest.raises(InputError, match="is not in the folder"):
            act(name)
    with pytest.raises(InputError):
        folder.take_in(name, b"x")
    assert (folder.root.parent / "secret").read_text() == "secret"


def test_every_version_comes_back_in_turn_and_comments_stay(folder: Folder) -> None:
    texts = [f"# a comment\nn = {number}  # of runs\n" for number in range(4)]
    for text in texts:
        folder.write("a.toml", text)
    folder.write("a.toml", texts[-1])  # no change, no version
    folder.change("a.toml", lambda tables: tables.__setitem__("n", 9))
    assert folder.path("a.toml").read_text() == "# a comment\nn = 9  # of runs\n"
    for text in reversed(texts):
        folder.undo("a.toml")
        assert folder.path("a.toml").read_text() == text
    with pytest.raises(InputError, match="no earlier version"):
        folder.undo("a.toml")
    for number in range(MOST_VERSIONS + 5):
        folder.write("a.toml", str(number))
    assert folder.versions("a.toml") == MOST_VERSIONS


def test_files_that_are_too_many_to_list_are_told(folder: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("expdesign.web.folder.MOST_FILES", 2)
    for name in ("a.csv", "b.csv", "c.csv"):
        folder.write(name, "x")
    assert [path.name for path in folder.files()] == ["a.csv", "b.csv"]
    assert "only the first 2" in folder.too_many


def test_a_file_handed_over_replaces_no_other(folder: Folder) -> None:
    assert folder.take_in("log.csv", b"one") == "log.csv"
    assert folder.take_in("log.csv", b"one") == "log.csv"
    assert folder.take_in("log.csv", b"two") == "log-2.csv"
    assert folder.path("log.csv").read_bytes() == b"one"


def test_names_that_downloads_and_loggers_give_are_taken(folder: Folder) -> None:
    for name in ("log (1).csv", "Übung 3, Süd.csv", "_50% #2 [b].csv", "zig+zag&circle's.nmea"):
        assert folder.take_in(name, b"x", beside=Path("logs")) == f"logs/{name}"
    for name in ("", "..", ".hidden", "-o.csv", "a/b.csv", "a\\b.csv", "a\n.csv", "a\0.csv", 121 * "a" + ".csv"):
        with pytest.raises(InputError, match="is not taken"):
            folder.take_in(name, b"x")


def test_what_is_no_file_is_left_out(folder: Folder) -> None:
    folder.write("a.toml", "[ship]\n[thrusters]\n")
    folder.path("gone.toml").symlink_to(folder.root / "nothing.toml")
    os.mkfifo(folder.root / "pipe.toml")
    assert [path.name for path in folder.files()] == ["a.toml"]
    assert folder.of_kind("card") == ("a.toml",)


WRITES = {
    "a new file": lambda folder: folder.write("b.toml", "n = 2\n"),
    "an old file": lambda folder: folder.write("a.toml", "n = 2\n"),
    "a key": lambda folder: folder.change("a.toml", lambda tables: tables.__setitem__("n", 2)),
    "an earlier version": lambda folder: folder.undo("a.toml"),
    "a file handed over": lambda folder: folder.take_in("log.csv", b"n = 2\n"),
}


@pytest.mark.parametrize(
    ("written", "parts"),
    [*((name, 0) for name in WRITES), ("an old file", 1), ("a key", 1)],  # these keep a version
)
def test_a_full_disk_is_told_and_leaves_all_as_it_was(
    folder: Folder, written: str, parts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for text in ("n = 0\n", "n = 1\n"):
        folder.write("a.toml", text)
    before = {path: path.read_bytes() for path in folder.root.rglob("*") if path.is_file()}
    plain, done = Path.write_bytes, []

    def full(path: Path, content: bytes) -> int:
        done.append(path)
        if len(done) > parts:
            plain(path, content[:2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return plain(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"(a|b|log)\.(toml|csv): cannot be written: No space left on device"):
        WRITES[written](folder)
    assert {path: path.read_bytes() for path in folder.root.rglob("*") if path.is_file()} == before


def asked(gate: Gate, *, host: str, origin: str = "", token: str = "", cookie: str = "", kind: str = "http") -> int:
    """Status of a request, 0 where a socket is closed."""
    headers = [(name.encode(), value.encode()) for name, value in
               (("host", host), ("origin", origin), ("cookie", cookie)) if value]  # fmt: skip
    scope = {"type": kind, "method": "GET", "path": "/", "headers": headers, "query_string": f"token={token}".encode()}
    sent: list[dict[str, object]] = []

    async def send(message: dict[str, object]) -> None:
        sent.append(message)

    async def receive() -> dict[str, object]:
        return {"type": "http.request"}

    asyncio.run(gate(scope, receive, send))
    return int(sent[0].get("status", 0))


async def hello(scope, receive, send) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b""})


def test_only_this_machines_own_pages_may_ask() -> None:
    gate = Gate(hello, hosts=("127.0.0.1", "localhost"), token=None)
    assert asked(gate, host="127.0.0.1:8120") == 200
    assert asked(gate, host="localhost:8120", origin="http://localhost:8120") == 200
    assert asked(gate, host="evil.example") == 403  # a name that was made to point here
    for kind, refused in (("http", 403), ("websocket", 0)):
        assert asked(gate, host="localhost:8120", origin="http://evil.example", kind=kind) == refused


def test_others_need_the_token() -> None:
    gate = Gate(hello, hosts=(), token="right")
    assert asked(gate, host="10.0.0.2:8120") == 403
    assert asked(gate, host="10.0.0.2:8120", token="wrong") == 403
    assert asked(gate, host="10.0.0.2:8120", token="right") == 200
    assert asked(gate, host="10.0.0.2:8120", cookie="expdesign_token=right") == 200
    assert asked(gate, host="10.0.0.2:8120", kind="websocket") == 0


REMEDIES = {
    "with plan.clearance_m = 5 there is such a path; the rest of the plan was not tried with it": (
        ("plan", "clearance_m"),
        5,
    ),
    "with plan.confidence = 0.9 drawn trials accept the plan": (("plan", "confidence"), 0.9),
    'with design.excluded = ["a", "b-2"] the search finds a place for every run': (
        ("design", "excluded"),
        ["a", "b-2"],
    ),
    "with plan.planner = 'beam' every run is sailed": (("plan", "planner"), "beam"),
    "goal.heading_deg = 240 has such a path": (("goal", "heading_deg"), 240),
    "no single change of those tried helps (plan.confidence = 0.9)": None,
    "the draft is runs/a/refused.html": None,
}


@pytest.mark.parametrize("remedy", REMEDIES)
def test_remedies_of_one_key_are_changes_of_the_scenario(remedy: str) -> None:
    change = change_in(remedy)
    assert change == REMEDIES[remedy]
    if change:
        (table, key), _ = change
        part = ScenarioFile.fields()[table].annotation
        assert key in part.fields()


def test_values_are_put_where_tables_are_missing_and_taken_away() -> None:
    tables: dict = {"a": {"x": 1}}
    put(tables, ("b", "c", "y"), 2)
    put(tables, ("list", 0), {"n": 1})
    put(tables, ("list", 1), {"n": 2})
    put(tables, ("a", "x"), None)
    assert tables == {"a": {}, "b": {"c": {"y": 2}}, "list": [{"n": 1}, {"n": 2}]}


@pytest.mark.thorough
def test_commands_run_report_and_stop(tmp_path: Path) -> None:
    async def work() -> None:
        jobs = Jobs(tmp_path)
        made = jobs.start(requests.New(folder=Path("craft"), kind="asv"))
        wrong = jobs.start(requests.Run(scenario=Path("nothing.toml")))
        waiting = jobs.start(requests.Run(scenario=Path("craft/scenario.toml")))
        jobs.stop(waiting)
        while made.status is None or wrong.status is None:
            await asyncio.sleep(0.05)
        await jobs.end()
        assert (made.status, made.state) == (0, "done")
        assert (tmp_path / "craft/scenario.toml").exists()
        assert wrong.status == 2
        assert wrong.errors == ["error: nothing.toml: does not exist, expected a TOML file"]
        assert waiting.state == "stopped, nothing half-written"
        assert made.command == "expdesign new craft --kind asv"

    asyncio.run(work())


def test_results_of_an_earlier_command_are_not_shown_as_those_of_this_one(tmp_path: Path) -> None:
    page = tmp_path / "estimate.html"
    page.write_text("of before")
    job = Job(requests.New(folder=Path("craft"), kind="asv"), tmp_path)
    os.utime(page, (job.asked_s - 5.0, job.asked_s - 5.0))
    assert not job.wrote("estimate.html")
    assert not job.wrote("nothing.html")
    page.write_text("of this one")
    assert job.wrote("estimate.html")


def test_answers_are_those_of_the_commands(tmp_path: Path) -> None:
    new(tmp_path / "craft", kind="asv")
    scenario = str(tmp_path / "craft/scenario.toml")
    assert "problem" not in problem_of(scenario)
    assert clearance_of(scenario, 58.0, 11.0, 0.0)["clearance_m"] > 10
    assert clearance_of(scenario, 58.1, 11.0, 0.0) == {"inside": False, "clearance_m": 0.0}
    text = Path(scenario).read_text()
    stated = ends_of(scenario)["clearance_m"]
    assert stated == load_scenario(scenario).plan.clearance_m
    Path(scenario).write_text(re.sub(r"clearance_m = .*", "", text))
    assert ends_of(scenario)["clearance_m"] == PlanSettings.clearance_m != stated
    Path(scenario).write_text(text + "\n[design.accuracy]\nas = 'durations'\n")
    assert durations_of(scenario)["aside"] == ["accuracy"]
    Path(scenario).write_text(text)
    found = durations_of(scenario)
    shares = [run["duration_s"] for run in found["runs"]]
    assert sum(shares) == pytest.approx(found["total_s"])
    assert found["efficiency_at_least"] > 0.999
    best = max(found["runs"], key=lambda run: run["duration_s"])["name"]
    folder = Folder((tmp_path / "craft").resolve())
    folder.change("scenario.toml", lambda tables: tables["design"].__setitem__("excluded", [best]))
    assert next(run for run in durations_of(scenario)["runs"] if run["name"] == best)["repeats"] == 0
    folder.change("scenario.toml", lambda tables: tables["design"].__setitem__("total_s", -1.0))
    assert durations_of(scenario)["key"] == "design.total_s"
