"""A watched step trial: a step ends when it is over, bad ones come again, streams equal files, broken trials go on."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.records import read_levels
from expdesign.saved import restored, saved
from expdesign.step_trials import controls_of, levels_of
from expdesign.step_trials.live import Row, State, after_row, beginning, step_list
from expdesign.step_trials.live.watch import still_to_come
from expdesign.workflows.steps.step_list import listed_steps
from export_case import plan, plan_files
from live_case import SHORT, Crew, list_csv, plateau_of, rows_csv, watch_setup
from step_case import GUESS, INPUTS

pytestmark = pytest.mark.usefixtures("undrawn")


def words(folder: Path, data: str, *more: str, steps: str = "list.csv") -> list[str]:
    files = [str(folder / data) if data != "-" else "-", "--steps", str(folder / steps), "--vessel", str(GUESS)]
    return ["watch-steps", *files, "--learn-s", "60", *more]


@pytest.fixture
def sailed(tmp_path: Path) -> Path:
    crew = Crew(watch_setup(), 1)
    assert not crew.sail(2000.0).left
    (tmp_path / "trial.csv").write_text(rows_csv(crew.rows))
    (tmp_path / "list.csv").write_text(list_csv())
    return tmp_path


@pytest.mark.thorough
def test_a_crew_that_does_as_it_is_told_sails_every_step_once_and_where_it_is_steady() -> None:
    for seed in range(10):
        crew = Crew(watch_setup(), seed)
        state = crew.sail(3000.0)
        assert [one.number for one in state.finished] == [1, 2, 3, 4, 5]
        found = np.array([one.state for one in state.finished])
        std = np.array([one.state_std for one in state.finished])
        truth = np.array([plateau_of(level) for level in SHORT[1:]])
        assert np.all(np.abs(found - truth) < 5 * std + 0.05 * np.ptp(truth, axis=0))
        assert crew.events[-1].kind == "done"


def test_steps_that_go_wrong_are_named_and_sailed_again_at_the_end() -> None:
    def errs(time_s: float) -> str:
        return "gap" if 75.0 < time_s < 80.0 else ""

    crew = Crew(watch_setup(), 2, errs)
    state = crew.sail(3000.0)
    assert [one.number for one in state.finished] == [2, 3, 4, 5, 1]
    bad = [event for event in crew.events if event.kind == "bad"]
    assert [event.step and event.step.number for event in bad] == [1]
    assert "a gap of" in bad[0].why
    approach = next(event for event in crew.events if event.following and event.following[1] is None)
    assert approach.following == ((4.0, 0.1), None)


def test_commands_that_change_too_early_spoil_a_step_and_other_commands_are_told() -> None:
    setup = watch_setup()
    crew = Crew(setup, 3)
    crew.sail(3000.0)
    begins = next(event.time_s for event in crew.events if event.kind == "begun")
    rows = [row for row in crew.rows if row.time_s < begins + 4.0]
    strange = [replace(rows[-1], time_s=rows[-1].time_s + 0.5 * k, inputs=(10.0, 0.2)) for k in range(1, 20)]
    state, kinds = beginning(setup), []
    for row in [*rows, *strange]:
        state, events = after_row(state, row, setup)
        kinds += [event.kind for event in events]
    assert kinds[-2:] == ["bad", "unlisted"]
    assert (state.left[-1].number, state.left[-1].attempts) == (1, 1)


def test_a_step_that_nothing_answers_is_left_out_after_some_attempts() -> None:
    levels = ((8.0, 0.1), (8.0, 0.3))
    setup = watch_setup(levels)
    rng = np.random.default_rng(4)
    state = beginning(setup)
    for k in range(1400):  # to and fro, 80 s each
        noise = rng.standard_normal(2)
        motion = (4.0 + 0.03 * noise[0], np.nan, 0.04 + 0.003 * noise[1])
        row = Row(time_s=0.5 * k, motion=motion, inputs=levels[int(k * 0.5 // 80) % 2])
        state, _ = after_row(state, row, setup)
    assert [(one.number, one.attempts) for one in state.left_out] == [(1, 3)]
    assert "standard errors" in state.left_out[0].why


def test_the_state_goes_through_a_file_to_the_last_bit() -> None:
    setup = watch_setup()
    crew = Crew(setup, 5)
    crew.sail(3000.0)

    def after(rows: list[Row], state: State) -> State:
        for row in rows:
            state, _ = after_row(state, row, setup)
        return state

    half = len(crew.rows) // 2
    once = after(crew.rows, beginning(setup))
    broken = restored(State, json.loads(json.dumps(saved(after(crew.rows[:half], beginning(setup))))))
    assert saved(after(crew.rows[half:], broken)) == saved(once)


@pytest.mark.thorough
def test_a_stream_tells_what_a_file_does_and_a_broken_off_watch_goes_on(
    sailed: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def told(*arguments: str) -> list[str]:
        assert main(words(sailed, *arguments)) == 0
        return [line for line in capsys.readouterr().out.splitlines() if " s  " in line]

    whole = told("trial.csv", "--out", str(sailed / "file"))
    text = (sailed / "trial.csv").read_text()
    monkeypatch.setattr("sys.stdin", io.StringIO(text))
    assert told("-", "--out", str(sailed / "stream")) == whole
    lines = text.splitlines(keepends=True)
    (sailed / "part.csv").write_text("".join(lines[: len(lines) // 2]))
    first = told("part.csv", "--out", str(sailed / "broken"))
    (sailed / "part.csv").write_text(text)
    assert first + told("part.csv", "--out", str(sailed / "broken"), "--resume") == whole
    for name in ("watch-steps.json", "steps-to-do.csv"):
        one, other = ((sailed / folder / name).read_text() for folder in ("file", "broken"))
        if name.endswith("json"):
            assert json.loads(one)["finished"] == json.loads(other)["finished"]
        else:
            assert one == other


def test_what_a_step_still_brings_is_the_mean_of_its_exponential() -> None:
    constants_s = np.array([4.0, 1.5])
    time_s = np.linspace(9.0, 19.0, 20_001)
    missing = [np.exp(-time_s / constant).mean() for constant in constants_s]
    assert still_to_come(constants_s, passed_s=9.0, lasts_s=10.0) == pytest.approx(missing, rel=1e-3)


def test_speeds_are_over_ground_and_are_called_so(sailed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    header, *lines = (sailed / "trial.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines]
    with_current = [",".join([time_s, repr(float(u) + 0.5), *rest]) for time_s, u, *rest in rows]
    (sailed / "current.csv").write_text("\n".join([header, *with_current]) + "\n")
    found = {}
    for name in ("trial", "current"):
        assert main(words(sailed, f"{name}.csv", "--out", str(sailed / name))) == 0
        told = capsys.readouterr().out
        assert told.count(" m/s") == told.count(" m/s over ground") > 5
        assert "Speeds U of steps are over ground" in told
        found[name] = json.loads((sailed / name / "watch-steps.json").read_text())
        assert found[name]["U_is"] == "over ground"
    speeds = [[one["U_mps"] for one in found[name]["finished"]] for name in ("trial", "current")]
    assert np.subtract(speeds[1], speeds[0]) == pytest.approx(0.5, abs=1e-6)


def test_what_is_left_of_a_broken_trial_is_a_list_of_steps_with_their_numbers(sailed: Path) -> None:
    text = (sailed / "trial.csv").read_text().splitlines(keepends=True)
    (sailed / "part.csv").write_text("".join(text[: 3 * len(text) // 4]))
    assert main(words(sailed, "part.csv", "--out", str(sailed / "out"), "--quiet")) == 0
    found = json.loads((sailed / "out" / "watch-steps.json").read_text())
    done, to_do = ([one["step"] for one in found[name]] for name in ("finished", "to_do"))
    assert done
    assert to_do
    assert sorted(done + to_do) == [1, 2, 3, 4, 5]
    values, _, numbers = read_levels(sailed / "out" / "steps-to-do.csv", inputs=INPUTS)
    listed = step_list(INPUTS, values, controls_of(INPUTS), numbers=numbers)
    assert [step.number for step in listed.steps] == to_do
    places = [step.number for step in listed.steps]
    assert [(step.before, step.after) for step in listed.steps] == [(SHORT[k - 1], SHORT[k]) for k in places]


@pytest.mark.parametrize(
    ("rows", "status", "what"),
    [
        ("n1_rps\n4\n8\n", 2, "names no rudder1_rad"),
        ("n1_rps,rudder1_rad\n4,0.1\n4,x\n", 2, "rudder1_rad: is 'x' in row 3"),
        ("n1_rps,rudder1_rad\n4,0.1\n4,0.1\n", 2, "never changes a command"),
        ("n1_rps,rudder1_rad\n4,0.1\n8,0.1\n", 3, "no step of the rudder"),
        ("n1_rps,rudder1_rad\n5,0.1\n8,0.1\n8,0.3\n", 3, "never hold n1_rps = 5"),
        ("n1_rps,rudder1_rad\n4,0.1\n15,0.1\n15,0.3\n", 3, "hold no step of the list"),
    ],
)
def test_lists_and_data_that_do_not_fit_are_refused_in_one_line(
    sailed: Path, capsys: pytest.CaptureFixture[str], rows: str, status: int, what: str
) -> None:
    (sailed / "bad.csv").write_text(rows)
    short = (sailed / "trial.csv").read_text().splitlines(keepends=True)[:130]
    (sailed / "short.csv").write_text("".join(short))
    assert main(words(sailed, "short.csv", "--out", str(sailed / "out"), "-q", steps="bad.csv")) == status
    told = capsys.readouterr().err
    assert what in told
    assert told.count("\n") == 1


def test_runs_of_a_plan_are_a_list_of_steps_and_ways_to_their_first_commands_are_none(tmp_path: Path) -> None:
    for name, text in plan_files().items():
        (tmp_path / name).write_text(text)
    names = ("tau_x", "tau_y", "tau_psi")
    steps = listed_steps(tmp_path / "plan.json", names, controls_of(names), None)
    runs = [leg for leg in plan().legs if leg.kind == "primitive"]
    levels = [levels_of(plan().commands.values[leg.first : leg.last], 1.0) for leg in runs]
    assert len(steps.steps) == sum(len(values) - 1 for values, _ in levels if len(values))
    assert steps.start == tuple(levels[0][0][0])
    assert steps.first_s == levels[0][1][0]
    ends = [tuple(values[-1]) for values, _ in levels if len(values)]
    begins = [tuple(values[0]) for values, _ in levels if len(values)]
    between = set(zip(ends, begins[1:], strict=False))
    assert not between & {(step.before, step.after) for step in steps.steps}


def test_a_list_holds_its_own_changes_of_command_and_no_others() -> None:
    steps = step_list(INPUTS, np.array(SHORT), controls_of(INPUTS))
    assert all(steps.holds(np.array(one), np.array(other)) for one, other in pairwise(SHORT))
    assert steps.holds(np.array([4.01, 0.1]), np.array([8.0, 0.101]))
    assert not steps.holds(np.array([12.0, 0.1]), np.array([4.0, 0.1]))
    assert not steps.holds(np.array([8.0, 0.3]), np.array([12.0, 0.3]))
