"""The command line hands over what was typed, and keeps results on stdout apart from progress on stderr."""

import json
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import expdesign
from expdesign.cli import main
from expdesign.cli.entry import repeat_option
from expdesign.export.document import Document, fact_rows
from expdesign.requests import Request
from expdesign.workflows.outcome import Outcome, workflow
from short_examples import copied

SUMMARY = {
    "total_s": 3600.0,
    "clearance_min_m": 21.25,
    "efficiency": {"repeats": 0.98},
    "reposition_bound_s": None,
    "verified": True,
    "parameters": ["X_u", "X_mu"],
}
ESTIMATE = {
    "vessel": Path("v.toml"),
    "methods": (),
    "fixed": (),
    "velocity": "auto",
    "mean": "complete",
    "blocks": "one",
    "start": "auto",
    "motion": "continuous",
    "horizon_s": None,
    "constant": False,
    "steered": "auto",
    "samples": "all",
    "offset_mps": 0.0,
    "prior": "none",
    "tests": (),
}
MONITOR = {
    "vessel": Path("v.toml"),
    "reference": (),
    "learn_h": 24.0,
    "false_alarm_days": 30.0,
    "size": 0.1,
    "every_s": 3600.0,
    "port_h": 1.0,
    "jobs": 0,
    "velocity": "auto",
    "model": "vessel",
    "resume": False,
}
PLAIN = {"departure": None, "tolerance_m": None, "fine": False, "name": None}
SHARED = {"jobs": 0, "scheduler": None, "cache": True}
REPLAN = {
    **SHARED,
    "data": (Path("d.csv"),),
    "vessel": None,
    "remaining_s": None,
    "interest": (),
    "stopped": False,
    "seed": 0,
}
COMMANDS = ("run", "score", "durations", "plan", "export", "simulate", "estimate", "replan")


FILES = (Path("runs/a/plan.json"), Path("runs/a/report.html"))


@dataclass
class Workflows:
    """Stands in for the workflows: notes what it is asked for and reports progress."""

    calls: list[tuple[str, Request, dict[str, object]]] = field(default_factory=list)
    summary: dict[str, object] = field(default_factory=lambda: dict(SUMMARY))

    def __getattr__(self, name: str) -> object:
        def work(request: Request, *, progress: object, **options: object) -> Outcome:
            self.calls.append((name, request, options))
            for fraction in (0.0, 0.01, 0.5, 1.0):
                progress("at work", fraction)  # type: ignore[operator]
            return Outcome(files=FILES, document=Document(facts=self.summary))

        return work


@pytest.fixture
def workflows(monkeypatch: pytest.MonkeyPatch) -> Workflows:
    stand_in = Workflows()
    monkeypatch.setattr(expdesign, "workflows", stand_in, raising=False)
    return stand_in


@pytest.mark.parametrize(
    ("typed", "name", "arguments", "options"),
    [
        ("run a.toml", "run", (Path("a.toml"), None), {"vessel": None, "draft": False, "seed": 0, **SHARED}),
        (
            "run a.toml --out o --seed 7 --jobs 1 --no-cache",
            "run",
            (Path("a.toml"), Path("o")),
            {"vessel": None, "draft": False, "seed": 7, "jobs": 1, "scheduler": None, "cache": False},
        ),
        ("score --seed 1 a.toml", "score", (Path("a.toml"), None), {"vessel": None, "seed": 1}),
        (
            "durations a.toml",
            "durations",
            (Path("a.toml"), None),
            {"vessel": None, "seed": 0, "grow": False, "monte_carlo": 0, "jobs": 0},
        ),
        ("plan a.toml", "plan", (Path("a.toml"), None), {"vessel": None, "seed": 0, **SHARED, "durations": None}),
        (
            "plan a.toml --durations d.json --vessel v.toml",
            "plan",
            (Path("a.toml"), None),
            {"vessel": Path("v.toml"), "seed": 0, **SHARED, "durations": Path("d.json")},
        ),
        ("export p.json --format rtz gpx", "export", (Path("p.json"), None), {"formats": ("rtz", "gpx"), **PLAIN}),
        (
            "export --format rtz p.json --format csv",
            "export",
            (Path("p.json"), None),
            {"formats": ("rtz", "csv"), **PLAIN},
        ),
        (
            "indices --vessel v.toml",
            "indices",
            ((), None),
            {
                "vessel": Path("v.toml"),
                "speed_mps": None,
                "scale": 1.0,
                "antenna_forward_m": 0.0,
                "depth_m": None,
                "wind_mps": None,
                "sea_state": None,
            },
        ),
        (
            "foresee s.toml",
            "foresee",
            (Path("s.toml"), None),
            {"plan": None, "operation": None, "jobs": 1, "cache": True, "seed": 0},
        ),
        (
            "foresee s.toml --plan p.json --out o --jobs 2 --no-cache --seed 3",
            "foresee",
            (Path("s.toml"), Path("o")),
            {"plan": Path("p.json"), "operation": None, "jobs": 2, "cache": False, "seed": 3},
        ),
        (
            "foresee s.toml --operation 5",
            "foresee",
            (Path("s.toml"), None),
            {"plan": None, "operation": 5, "jobs": 1, "cache": True, "seed": 0},
        ),
        (
            "simulate p.json --truth v.toml",
            "simulate",
            (Path("p.json"), None),
            {"seed": 0, "truth": Path("v.toml"), "until_s": None},
        ),
        (
            "simulate p.json --truth v.toml --until 600 --seed 2",
            "simulate",
            (Path("p.json"), None),
            {"seed": 2, "truth": Path("v.toml"), "until_s": 600.0},
        ),
        ("replan s.toml --data d.csv", "replan", (Path("s.toml"), None), REPLAN),
        (
            "replan s.toml --data a.csv b.csv --vessel v.toml --remaining 300 --interest Y_v N_r --out o",
            "replan",
            (Path("s.toml"), Path("o")),
            {
                "data": (Path("a.csv"), Path("b.csv")),
                "vessel": Path("v.toml"),
                "remaining_s": 300.0,
                "interest": ("Y_v", "N_r"),
                "stopped": False,
                **SHARED,
                "seed": 0,
            },
        ),
        ("estimate d.csv --vessel v.toml", "estimate", ((Path("d.csv"),), None), ESTIMATE),
        (
            "estimate a.csv b.csv --vessel v.toml --method ls iv --fixed X_u N_r --test c.csv d.csv --out o",
            "estimate",
            ((Path("a.csv"), Path("b.csv")), Path("o")),
            ESTIMATE | {"methods": ("ls", "iv"), "fixed": ("X_u", "N_r"), "tests": (Path("c.csv"), Path("d.csv"))},
        ),
        (
            "estimate --method iv a.csv --vessel v.toml --velocity smoothed --mean none --start ls",
            "estimate",
            ((Path("a.csv"),), None),
            ESTIMATE | {"methods": ("iv",), "velocity": "smoothed", "mean": "none", "start": "ls"},
        ),
        (
            "monitor a.csv b.csv --vessel v.toml --reference c.csv d.csv --size 0.2 --model yaw-full",
            "monitor",
            ((Path("a.csv"), Path("b.csv")), None),
            MONITOR | {"reference": (Path("c.csv"), Path("d.csv")), "size": 0.2, "model": "yaw-full"},
        ),
        (
            "identify-steps a.csv b.csv --vessel v.toml --throttle n1 n2 --rudder a1 a2 --test c.csv --seed 3",
            "identify_steps",
            ((Path("a.csv"), Path("b.csv")), None),
            {
                "vessel": Path("v.toml"),
                "throttle": ("n1", "n2"),
                "rudder": ("a1", "a2"),
                "tests": (Path("c.csv"),),
                "steps": None,
                "velocity": "auto",
                "seed": 3,
            },
        ),
        ("monitor - --vessel v.toml --resume", "monitor", ((Path("-"),), None), MONITOR | {"resume": True}),
    ],
)
def test_what_was_typed_reaches_the_workflow(
    workflows: Workflows, typed: str, name: str, arguments: tuple[object, ...], options: dict[str, object]
) -> None:
    assert main(typed.split()) == 0
    ((called, typed_request, given),) = workflows.calls
    assert (called, given) == (name, {})

    def work(request: Request, *, progress: object) -> Request:
        return request

    work.__name__ = name
    called_request = workflow(work)(*arguments, **options)
    names = [one.name for one in typed_request.asked()]
    assert [getattr(typed_request, one) for one in names] == [getattr(called_request, one) for one in names]


@pytest.mark.parametrize(
    ("typed", "spelled"),
    [
        ("p.json --format a b c", "p.json --format a --format b --format c"),
        ("--format a b p.json --quiet", "--format a --format b p.json --quiet"),
        ("--format a --quiet b", "--format a --quiet b"),
        ("--format", "--format"),
        ("run x y", "run x y"),
    ],
)
def test_a_list_of_values_is_the_option_repeated(typed: str, spelled: str) -> None:
    assert repeat_option(typed.split(), "--format") == spelled.split()
    assert repeat_option(spelled.split(), "--format") == spelled.split()


def test_json_is_alone_on_stdout_and_progress_on_stderr(
    workflows: Workflows, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["run", "a.toml", "--json"])
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {
        "command": "run",
        "files": ["runs/a/plan.json", "runs/a/report.html"],
        "summary": SUMMARY,
        "findings": [],
        "notes": [],
    }
    assert captured.err.splitlines() == ["[  0%] at work", "[ 50%] at work", "[100%] at work"]


def test_numbers_come_with_their_units_and_files_with_their_folder(
    workflows: Workflows, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["run", "a.toml"])
    lines = capsys.readouterr().out.splitlines()
    said = {label: value for label, _, value in (re.split(r"( {2,}|$)", line.strip(), maxsplit=1) for line in lines)}
    assert said["total"] == "3600 s"
    assert said["clearance min"] == "21.25 m"
    assert said["efficiency, repeats"] == "0.98"
    assert said["reposition bound"] == "-"
    assert said["verified"] == "yes"
    assert said["parameters"] == "X_u, X_mu"
    assert "Written to runs/a/: plan.json, report.html" in said
    assert "Open runs/a/report.html in a browser." in said


@pytest.mark.parametrize(("draft", "status"), [(False, 3), (True, 0)])
def test_a_plan_that_is_not_verified_ends_with_the_status_of_no_answer(
    workflows: Workflows, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], draft: bool, status: int
) -> None:
    facts = {"verified": False, "verdict": "20 % were aborted", **({"draft": True} if draft else {})}
    monkeypatch.setattr(workflows, "summary", facts)
    assert main(["run", "a.toml", "--quiet"]) == status
    told = "expdesign: error: the plan is written but not verified: 20 % were aborted\n"
    assert capsys.readouterr().err == (told if status else "")


def test_quiet_says_nothing(workflows: Workflows, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "a.toml", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_quiet_with_json_says_only_json(workflows: Workflows, capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "a.toml", "--quiet", "--json"])
    captured = capsys.readouterr()
    assert json.loads(captured.out)["summary"] == SUMMARY
    assert captured.err == ""


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert all(f" {name} " in told for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    told = capsys.readouterr().out
    assert f"expdesign {name}" in told
    assert "--out" in told
    assert "--json" in told
    named = {"roll": "[roll]", "incline": "[roll]", "durations": "[design.grow]"}
    assert named.get(name, "") in told  # no markup that is left out


def test_help_loads_no_solver() -> None:
    loaded, _ = modules_after(("--help",))
    assert "typer" in loaded
    assert not {"casadi", "cvxpy", "ompl", "matplotlib", "scipy", "numpy"} & loaded


@pytest.mark.thorough
def test_a_mistyped_key_is_told_before_solvers_load_and_processes_start(tmp_path: Path) -> None:
    scenario = copied(tmp_path, "story", {"total_s = 720.0": "totl_s = 720.0"})
    calls = [(command, str(scenario)) for command in ("run", "plan", "durations", "score")]
    loaded, told = modules_after(*calls)
    assert told.count("totl_s") == len(calls)
    assert "expdesign.scenario.design_file" in loaded
    slow = ("cvxpy", "matplotlib.", "pyogrio", "joblib.externals.loky.backend.popen_loky_posix")
    slow += tuple(f"scipy.{part}" for part in ("fft", "interpolate", "linalg", "ndimage", "optimize", "signal"))
    slow += tuple(f"scipy.{part}" for part in ("sparse", "spatial", "special", "stats"))
    assert [name for name in loaded if name.startswith(slow)] == []


def modules_after(*calls: tuple[str, ...]) -> tuple[set[str], str]:
    """Names of the modules that calls of the program have loaded when they end, and what they say on stderr."""
    code = f"import sys; from expdesign.cli import main; [*map(main, {calls})]; print(*sys.modules, sep='\\n')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()), done.stderr


def test_the_module_is_the_console_script() -> None:
    done = subprocess.run([sys.executable, "-m", "expdesign", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"expdesign {expdesign.__version__}\n"


def test_what_nobody_knows_has_no_unit() -> None:
    rows = dict(fact_rows({"day_median_s": float("nan"), "bound_s": None, "day_s": 60.0}))
    assert rows == {"day median": "-", "bound": "-", "day": "60 s"}


def test_a_fact_in_hours_is_told_in_hours_and_minutes() -> None:
    rows = dict(fact_rows({"judged_h": 1.9792, "left_out_h": float("nan")}))
    assert rows == {"judged": "1\N{NO-BREAK SPACE}h\N{NO-BREAK SPACE}59\N{NO-BREAK SPACE}min", "left out": "-"}
