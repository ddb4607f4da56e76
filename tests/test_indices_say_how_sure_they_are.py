"""Simulated indices have intervals: of ships that the vessel file's standard deviations allow, and of single trials."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.export.files import vessel_toml
from expdesign.particulars import SCATTER, Expected, expected, standard_trials
from expdesign.particulars.intervals import DRAWS
from expdesign.particulars.trials import Fleet
from expdesign.scenario import load_vessel
from expdesign.vessel import Missed, Vessel
from scenario_files import SCENARIOS

VESSELS = SCENARIOS / "vessels"
COASTER = load_vessel(VESSELS / "coaster-80m.toml")
SPEED = 6.5


def uncertain(share: float) -> Vessel:
    """The coaster, every parameter by itself uncertain by a share."""
    model = COASTER.model
    known = replace(model, parameter_std=share * np.abs(model.parameters), parameter_correlation={})
    return replace(COASTER, model=known)


def scatter_of(one: Expected, missed: Missed | None) -> float:
    """Standard deviation of a trial's result beside what parameters explain: of overshoots themselves, else of logs."""
    if missed is None or one.quantity in ("reach_m", "time_s"):
        return SCATTER[one.quantity]
    if one.quantity.startswith("overshoot"):
        return missed.turn_share * (one.trial.angle_rad + one.value)
    if one.quantity.startswith("speed"):
        return missed.way_share
    return missed.turn_share if one.quantity.startswith("time") else math.hypot(missed.way_share, missed.turn_share)


@pytest.mark.parametrize("missed", [None, Missed(way_share=0.02, turn_share=0.03)])
def test_of_a_ship_that_is_known_trials_scatter_alone(missed: Missed | None) -> None:
    """Ends are quantiles of normal logarithms or angles, each within four of its standard errors."""
    quantile, share = 1.96, 0.025
    density = math.exp(-(quantile**2) / 2) / math.sqrt(2 * math.pi)
    error = math.sqrt(share * (1 - share) / DRAWS) / density  # of a quantile, in standard deviations
    ship = uncertain(1e-9)
    ship = replace(ship, model=replace(ship.model, missed=missed))
    for one in expected(ship, standard_trials(SPEED, stops=True)):
        by_angle = missed is not None and one.quantity.startswith("overshoot")
        for end, side in ((one.low, -1.0), (one.high, 1.0)):
            apart = (end - one.value if by_angle else math.log(end / one.value)) / scatter_of(one, missed)
            assert abs(apart - side * quantile) < 4 * error, one.quantity


def test_intervals_hold_the_trials_of_ships_drawn_anew() -> None:
    """Of 200 other ships with one trial each, 95 % within four standard errors, of each quantity."""
    ship, trials, count = uncertain(0.1), standard_trials(SPEED, stops=False), 200
    rows = expected(ship, trials)
    rng = np.random.default_rng(7)
    others = ship.model.drawn_parameters(count, rng)
    fleet = Fleet(ship, others, fastest_mps=30.0)
    for trial in trials:
        for quantity, values in fleet.results(trial).items():
            one = next(row for row in rows if (row.trial, row.quantity) == (trial, quantity))
            sailed = np.nan_to_num(values, nan=np.inf) * np.exp(SCATTER[quantity] * rng.standard_normal(count))
            share = np.mean((one.low <= sailed) & (sailed <= one.high))
            assert share > 0.95 - 4 * math.sqrt(0.95 * 0.05 * (1 / count + 1 / DRAWS)), quantity


@pytest.mark.parametrize("stated", [True, False])
def test_the_command_tells_them_where_the_file_states_what_is_known(stated: bool, tmp_path: Path) -> None:
    ship = uncertain(0.1)
    if not stated:
        ship = replace(ship, model=replace(ship.model, parameter_std=np.zeros(len(ship.model.names))))
    path = tmp_path / "ship.toml"
    path.write_text(vessel_toml(ship))
    assert main(["indices", "--vessel", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    page = (tmp_path / "out" / "indices.html").read_text()
    assert ("How sure the simulated results are" in page) == stated
    found = json.loads((tmp_path / "out" / "indices.json").read_text())["simulated"]
    trials = {trial["name"]: trial for trial in found["trials"]}
    assert bool(found["intervals_95"]) == stated
    assert {row["run"] for row in found["intervals_95"]} == (set(trials) if stated else set())
    for row in found["intervals_95"]:
        assert row["low"] < row["value"] < row["high"]
        if row["quantity"] in trials[row["run"]]:
            assert row["value"] == trials[row["run"]][row["quantity"]]
