"""What files state and the trial does not use, or takes as certain, is said; the motion confirms it."""

import re
import tomllib
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.cli.commands import print_summary
from expdesign.errors import FileError
from expdesign.export.document import Document, Table, tabled
from expdesign.scenario import load_scenario
from expdesign.scenario.scenario_file import build_scenario
from expdesign.scenario.tables import Entry
from expdesign.signals import Commands
from expdesign.simulation import CALM, Environment, simulate
from expdesign.vessel import column_name
from expdesign.workflows.outcome import Outcome
from scenario_files import SCENARIOS, spoil, write_scenario

WIND, CURRENT, UNREAD, CERTAIN = (
    "environment.wind_to",
    "environment.current_to",
    "no term of the vessel",
    "exactly known",
)


def loaded(tmp_path, *changes):
    path = write_scenario(tmp_path)
    for old, new in changes:
        spoil(tmp_path / "vessel.toml", old, new)
    return load_scenario(path)


def merged(first, over):
    """A table with the entries of another put over it, at any depth."""
    return first | {key: merged(first.get(key, {}), one) if isinstance(one, dict) else one for key, one in over.items()}


def said(case, beginning):
    return [line for line in case.remarks if line.startswith(beginning)]


def track(vessel, environment=CALM, **commands):
    """Two minutes with some thrust on everything, except commands given by name."""
    names = vessel.model.inputs
    values = np.tile([commands.get(name, 0.3) for name in names], (120, 1))
    trajectory = simulate(
        vessel, Commands(sample_time_s=vessel.sample_time_s, names=names, values=values), environment=environment
    )
    return np.hstack([trajectory.pose, trajectory.velocity])


OTHERS = {"X_vr": 0.8, "Y_v": -0.3, "Y_ur": -0.8, "Y_mu": 0.01, "N_r": -0.15, "N_uv": 0.0, "N_mu": 0.00015}
TEN = [
    ('structure = "surge"', 'structure = "manoeuvring-10"'),
    ("W_abs_u_u = 0.0\n", ""),
    ("X_mu = 0.01", "\n".join(["X_mu = 0.01", *(f"{name} = {value}" for name, value in OTHERS.items())])),
]
SHIPS = {
    "surge": [],
    "surge in the air": [("W_abs_u_u = 0.0", "W_abs_u_u = -0.001")],
    "surge perhaps in the air": [("X_u = 0.06", "X_u = 0.06\nW_abs_u_u = 0.001")],
    "three degrees of freedom": TEN,
    "no thrust to the side": [*TEN, ("Y_mu = 0.01", "Y_mu = 0.0"), ("N_mu = 0.00015", "N_mu = 0.0")],
}


@pytest.mark.parametrize("name", SHIPS)
def test_the_wind_is_said_to_move_no_ship_exactly_where_it_moves_none(tmp_path, name):
    case = loaded(tmp_path, *SHIPS[name])
    ship = case.vessel
    drawn = replace(ship, model=ship.model.with_parameters(ship.model.parameters + ship.model.parameter_std))
    wind = Environment(wind_to=case.environment.wind_to)
    moved = np.abs(track(drawn, wind) - track(drawn)).max() > 0
    assert bool(said(case, WIND)) is not moved


@pytest.mark.parametrize("name", SHIPS)
def test_the_current_is_said_not_to_act_exactly_where_it_does_not(tmp_path, name):
    """A current along or across a ship that makes no other way gives her its velocity in time, or does not."""
    case = loaded(tmp_path, *SHIPS[name])
    lines = said(case, CURRENT)
    rest = dict.fromkeys(case.vessel.model.inputs, 0.0)
    for axis, column in (("u", 3), ("v", 4)):
        flow = Environment(current_to=np.eye(2)[column - 3] * 0.1)
        moved = abs(track(case.vessel, flow, **rest)[-1, column]) > 0.01
        assert any(f"does not act on {axis}" in line for line in lines) is not moved


@pytest.mark.parametrize("name", SHIPS)
def test_commands_are_said_to_move_no_ship_exactly_where_they_move_none(tmp_path, name):
    case = loaded(tmp_path, *SHIPS[name])
    lines = said(case, UNREAD)
    usual = track(case.vessel)
    for signal in case.vessel.model.inputs:
        moved = np.abs(track(case.vessel, **{signal: 0.7}) - usual).max() > 0
        assert any(column_name(signal) in line for line in lines) is not moved


def test_parameters_are_said_to_be_exactly_known_exactly_where_all_draws_have_one_value(tmp_path):
    for changes in ([], [("[model.parameter_std]\nX_u = 0.06\n", "")], [("X_u = 0.06", "X_u = 0.06\nX_mu = 0.001")]):
        model = loaded(tmp_path, *changes).vessel.model
        case = loaded(tmp_path, *changes)
        spread = np.ptp(model.drawn_parameters(50, np.random.default_rng(0)), axis=0)
        (line,) = said(case, CERTAIN)
        named = set(line.replace(",", " ").split())
        assert {name for name, width in zip(model.names, spread, strict=True) if width == 0} == named & set(model.names)
        assert ("every parameter" in line) is not spread.any()


@pytest.mark.parametrize(("name", "acts"), [("helsinki-hour", True), ("coaster", False), ("fast-boat-designed", False)])
def test_a_stated_search_for_paths_is_said_not_to_act_exactly_where_legs_are_curves(name, acts):
    case = load_scenario(SCENARIOS / f"{name}.toml")
    assert [line for line in case.remarks if "plan.paths" in line] == []
    stated = replace(case, plan=replace(case.plan, paths="visibility"))
    assert any("plan.paths does not act" in line for line in stated.remarks) is not acts


BESIDE = {
    "plan.lattice_spacing_m": ({"plan": {"lattice_spacing_m": 50.0}}, {"plan": {"planner": "lattice"}}),
    "design.outcome_speed_mps": (
        {"design": {"outcome_speed_mps": 1.5}},
        {"design": {"accuracy": {"outcomes_95": {"advance_m": 5.0}}}},
    ),
    "environment.current_to.correlation_s": (
        {"environment": {"current_to": {"north_mps": 0.0, "east_mps": 0.0, "correlation_s": 60.0}}},
        {"environment": {"current_to": {"variation_std_mps": 0.1}}},
    ),
    "environment.wind_to.correlation_s": (
        {"environment": {"wind_to": {"north_mps": 0.0, "east_mps": 0.0, "correlation_s": 60.0}}},
        {"environment": {"wind_to": {"variation_std_mps": 0.1}}},
    ),
}
"""Keys that act only beside others -> what states them, and what makes them act."""


@pytest.mark.parametrize("key", BESIDE)
def test_keys_that_act_only_beside_others_are_said_not_to_act_alone(key):
    content = tomllib.loads((SCENARIOS / "story.toml").read_text(encoding="utf-8"))
    alone, acting = BESIDE[key]
    entry = Entry(SCENARIOS / "story.toml")
    for changes, lines in (((), 0), ((alone,), 1), ((alone, acting), 0)):
        case = build_scenario(reduce(merged, changes, content), entry)
        assert len(said(case, f"{key} does not act")) == lines


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"outcome_units": {"advance_m": 2.0}}, "design.outcome_units: has no effect while design.outcomes is empty"),
        ({"reveal_sizes": {"wind": 0.5}}, "has no effect while design.reveal and design.tell_apart are empty"),
        ({"prior_samples": 5}, "design.prior_samples: has no effect while design.robust is 'nominal'"),
    ],
)
def test_sizes_of_what_nobody_asks_for_are_refused(changes, words):
    content = tomllib.loads((SCENARIOS / "story.toml").read_text(encoding="utf-8"))
    with pytest.raises(FileError, match=re.escape(words)):
        build_scenario(merged(content, {"design": changes}), Entry(SCENARIOS / "story.toml"))


def test_a_calm_scenario_of_a_ship_known_in_part_has_nothing_to_say(tmp_path):
    stds = "\n".join(f"{name} = 0.001" for name in ("X_u", "X_abs_u_u", "X_mu", *OTHERS))
    case = loaded(tmp_path, *TEN, ("X_u = 0.06", stds))
    assert replace(case, environment=CALM).remarks == ()
    assert len(case.remarks) == 1  # its wind


def test_a_command_says_them_on_the_terminal(tmp_path, capsys):
    path = loaded(tmp_path, *TEN).path
    spoil(tmp_path / "dictionary.toml", "period_s = 80.0\nspeed_mps = [0.5, 1.1]", "period_s = 80.0\nspeed_mps = 0.5")
    assert main(["score", str(path), "--out", str(tmp_path / "out")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    remarks = load_scenario(path).remarks
    assert remarks
    for line in remarks:
        assert line in told


@pytest.mark.parametrize("part", ["findings", "notes"])
def test_what_must_be_heard_is_told_beside_tables_however_long(capsys, part):
    long = " ".join(str(number) for number in range(200))
    table = Table(title="a", header=("b",), rows=(("c",),))
    print_summary(Outcome(files=(), document=Document(sections=tabled(table), **{part: (long,)})))
    assert long in " ".join(capsys.readouterr().out.split())
