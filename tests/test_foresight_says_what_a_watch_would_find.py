"""Simulated voyages say which changes a watch over a ship would find, how soon, and what it takes them for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from design_case import SCENARIOS
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.errors import InputError
from expdesign.export.foresight_page import (
    operation_document,
    operation_json,
    operation_row,
    operation_sentences,
)
from expdesign.export.pages import document_html
from expdesign.foresight import OperationForesight, foresee_operation, interval
from expdesign.foresight.operation import changed, hidden_changes, ordinary_orders, voyage
from expdesign.processes import local_processes
from expdesign.scenario import load_scenario, load_vessel
from expdesign.vessel import Environment, Variation
from expdesign.workflows import foresee

CASE = load_scenario(SCENARIOS / "story.toml")
WEATHER = Environment(current_variation=Variation(std_mps=0.03, correlation_s=300.0))
"""That a short reference is enough for: no voyage has a mean current of its own."""


def foreseen() -> OperationForesight:
    return foresee_operation(CASE.vessel, WEATHER, voyages=3, hours=0.5, sizes=(1e-4, 0.2), references=2, seed=4)


@pytest.fixture(scope="module")
def found() -> OperationForesight:
    with local_processes(1):
        return foreseen()


@pytest.mark.thorough
def test_large_changes_are_found_and_such_as_are_none_are_not(found: OperationForesight) -> None:
    tiny, large = ([item for item in found.rows if item.size == size] for size in (1e-4, 0.2))
    quiet = sum(item.found for item in tiny) + found.false_alarms
    voyages = sum(item.voyages for item in tiny) + found.nominal
    expected = voyages * 0.5 / 24.0 / found.false_alarm_days
    assert quiet <= expected + 4.0 * np.sqrt(expected) + 1.0
    by_name = {item.change: item for item in large}
    for name in ("less thrust", "more resistance ahead", "more inertia in yaw"):
        item = by_name[name]
        assert item.found == item.voyages
        assert item.likely == item.found
        assert item.delay_s < 1800.0


@pytest.mark.slow
def test_the_result_does_not_depend_on_the_number_of_processes(found: OperationForesight) -> None:
    with local_processes(2):
        again = foresee_operation(CASE.vessel, WEATHER, voyages=3, hours=0.5, sizes=(1e-4,), references=2, seed=4)
    assert again.rows == found.rows[::2]


def test_a_ship_changes_as_its_name_says() -> None:
    vessel = CASE.vessel
    ship = extended_model(vessel, voyage(vessel, CASE.environment, length_s=200.0, seed=0))
    before = dict(zip(vessel.model.names, vessel.model.parameters.tolist(), strict=True))
    for change in hidden_changes(ship):
        model = changed(vessel, ship, change, 0.25).model
        ratio = {
            name: value / before[name] if before[name] else 1.0
            for name, value in zip(model.names, model.parameters.tolist(), strict=True)
        }
        if change.name == "less thrust":
            assert (ratio["X_mu"], ratio["N_mu"], ratio["N_r"]) == pytest.approx((0.75, 0.75, 1.0))
        if change.name == "more inertia in yaw":
            assert (ratio["N_mu"], ratio["N_r"], ratio["X_mu"]) == pytest.approx((0.8, 0.8, 1.0))
        if change.name == "more mass":
            assert (ratio["X_mu"], ratio["Y_v"], ratio["Y_ur"], ratio["N_r"]) == pytest.approx((0.8, 0.8, 1.0, 1.0))
        if change.name == "more damping in yaw":
            assert (ratio["N_r"], ratio["N_mu"], ratio["Y_v"]) == pytest.approx((1.25, 1.0, 1.0))


@pytest.mark.parametrize("name", ["tender-20m", "azimuth-30m"])
def test_orders_of_voyages_keep_within_limits(name: str) -> None:
    vessel = load_vessel(SCENARIOS / "vessels" / f"{name}.toml")
    orders = ordinary_orders(vessel, 5000, stretch_s=60.0, rng=np.random.default_rng(0))
    for column, limit in zip(orders.T, vessel.limits, strict=True):
        assert limit.low <= column.min() <= column.max() <= limit.high
    assert np.ptp(orders, axis=0).max() > 0


@pytest.mark.parametrize(("count", "trials"), [(0, 8), (3, 8), (8, 8), (20, 100)])
def test_intervals_are_exact(count: int, trials: int) -> None:
    known = binomtest(count, trials).proportion_ci(0.95, "exact")
    assert interval(count, trials) == pytest.approx((known.low, known.high), abs=1e-9)


def test_page_file_and_table_agree() -> None:
    found = foresee_operation(CASE.vessel, WEATHER, voyages=1, hours=0.2, sizes=(0.2,), references=1, seed=4)
    told = json.loads(operation_json(found, vessel="tender"))
    page = document_html(operation_document(found, scenario="story", vessel="tender"))
    assert [row["found"] for row in told["changes"]] == [item.found for item in found.rows]
    assert f"Of {found.nominal} voyage of" in told["sentences"][0]
    for item in found.rows:
        assert operation_row(item)[0] in page
    assert all(text.endswith(".") for text in operation_sentences(found))


def test_a_plan_and_an_operation_are_not_foreseen_together(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--plan and --operation are given, expected one of them"):
        foresee(SCENARIOS / "story.toml", tmp_path, plan=tmp_path / "plan.json", operation=3)
