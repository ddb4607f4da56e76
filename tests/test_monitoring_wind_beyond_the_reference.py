"""Forces of a wind that no reference knows are learnt, and no change is judged by them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.monitoring import Calibration, Change, State, calibrate
from expdesign.monitoring.calibration import WINDS_REACH, _filtered
from expdesign.monitoring.evidence import stretches_of
from expdesign.monitoring.force import Known, after_gap, after_stretch, judged
from monitoring_case import CHANGES, STRETCH_S, drawn_columns, drawn_grams, grams_from, watched
from sea_case import FRESH, HOUR, WINDS, Sea, Ship, sailed, vessel_file, written

AIR = 0  # number of the change that acts by the wind; another is much like it
NAMES = tuple(
    Change(effect="term:W" if n == AIR else f"theta:p{n}", size=0.1, unit=(0.01, "%"), words=f"p{n}", air=n == AIR)
    for n in range(CHANGES)
)
SQUALL = slice(60, 70)


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrate(drawn_grams(80, seed=0, quick=0.1, slow=0.1), changes=NAMES)


def squall(calibration: Calibration, *, stronger: float, off: float) -> np.ndarray:
    """(120, samples, columns) of a ship as in the reference, whose air drag it told wrongly by `off` of its std."""
    columns = drawn_columns(120, seed=1, quick=0.1, slow=0.1)
    columns[SQUALL, :, AIR] *= stronger
    true = off * calibration.baseline_std
    columns[:, :, -1] += columns[:, :, :CHANGES] @ (
        calibration.baseline + np.where(np.arange(CHANGES) == AIR, true, 0.0)
    )
    return columns


def test_how_uncertain_forces_of_the_wind_are_is_counted_beside_the_unmeasured_force(calibration: Calibration) -> None:
    """Trace of the information that a stretch has of air drag, times its covariance; by matrices of samples."""
    columns = squall(calibration, stronger=3.0, off=0.0)
    known = calibration.begun(calibration.nuisance)
    products = stretches_of(grams_from(columns), calibration.std, calibration.ramp).products
    for index in (0, SQUALL.start):
        one = judged(products[index], CHANGES, known, loads=calibration.loads)
        starts = columns[index, :, CHANGES : CHANGES + 3] / calibration.std[0]
        air, force = (
            columns[index, :, [AIR]].T / calibration.std[0],
            columns[index, :, CHANGES + 3 : -1] / calibration.std[0],
        )
        twice = np.concatenate([force, force], axis=1)
        spread = np.eye(len(starts)) + 1e9 * starts @ starts.T + twice @ np.diag(calibration.force.variance) @ twice.T
        expected = (air.T @ np.linalg.solve(spread, air)).item() * calibration.baseline_covariance[AIR, AIR]
        assert calibration.by_wind(known, one) == pytest.approx(expected, rel=1e-4)


def test_no_stretch_of_the_reference_is_beyond_it(calibration: Calibration) -> None:
    grams = drawn_grams(80, seed=0, quick=0.1, slow=0.1)
    stretches = stretches_of(grams, calibration.std, calibration.ramp)
    _, information = _filtered(stretches, calibration.force)
    most = (information[:, AIR, AIR] * calibration.baseline_covariance[AIR, AIR]).max()
    assert calibration.wind_limit == pytest.approx(WINDS_REACH * most)
    assert watched(calibration, grams, 12.0)[0].wind_s == 0.0


def test_a_squall_is_learnt_and_not_judged_where_it_would_be_a_change_of_the_ship(calibration: Calibration) -> None:
    columns = squall(calibration, stronger=12.0, off=2.5)
    state, alarms, _ = watched(calibration, grams_from(columns), 12.0)
    assert not alarms
    assert state.wind_s == 10 * STRETCH_S
    assert state.left_out_s == state.wind_s
    place = len(calibration.force.variance) + np.flatnonzero(calibration.loads == AIR).item()
    left = state.known.mean[place] - 2.5 * calibration.baseline_std[AIR]
    assert abs(left) < 4.0 * np.sqrt(state.known.covariance[place, place])
    assert np.sqrt(state.known.covariance[place, place]) < calibration.baseline_std[AIR] / 4.0
    ignorant = replace(calibration, air=())
    assert watched(ignorant, grams_from(columns), 12.0)[1]


def test_a_change_that_lasts_is_found_after_a_squall(calibration: Calibration) -> None:
    columns = squall(calibration, stronger=12.0, off=2.5)
    columns[SQUALL.stop :, :, -1] += columns[SQUALL.stop :, :, 2]
    _, alarms, _ = watched(calibration, grams_from(columns), 12.0)
    assert [alarm.change for alarm in alarms][:1] == [2]
    assert alarms[0].since_s >= SQUALL.start * STRETCH_S  # of what was not judged nothing is known


def test_a_stretch_that_is_learnt_from_alone_adds_nothing_to_sums_but_what_the_force_took(
    calibration: Calibration,
) -> None:
    """Scores after it are those of all data less those of it alone: of the rest, given it."""
    products = stretches_of(grams_from(squall(calibration, stronger=1.0, off=0.0)), calibration.std, calibration.ramp)
    known: Known = calibration.begun(calibration.nuisance)
    both = without = State.begun(calibration, time_s=0.0).whole
    keep = calibration.nuisance.memory(STRETCH_S)
    for index in (0, 1):
        one = judged(products.products[index], CHANGES, known, loads=calibration.loads)
        if index:
            first = both.score, both.information
        both, without = both.added(one)[0], (without.added(one)[0] if index else without.unjudged(one))
        known = after_gap(after_stretch(known, one), calibration.nuisance, STRETCH_S)
        if not index:
            both, without = both.later(keep), without.later(keep)
    assert without.score == pytest.approx(both.score - first[0], rel=1e-9, abs=1e-9)
    assert without.information == pytest.approx(both.information - first[1], rel=1e-9, abs=1e-9)
    assert without.count == 1


@pytest.mark.thorough
def test_a_measured_squall_is_told_and_not_judged(tmp_path: Path) -> None:
    """Voyages 0 and 15 of seed 61000, in which the watch named thrust and an offset of the rudder before."""
    path, fresh = vessel_file(tmp_path / "vessel.toml"), Sea(wind=replace(FRESH, measured=True))
    number = list(WINDS).index(name := "a squall of 8 m/s more")
    seeds = [61000, 61150]
    references = sailed([Ship()] * 2, 4 * HOUR, seeds=seeds, sea=fresh)
    gale = Sea(wind=replace(WINDS[name], measured=True))
    voyages = sailed([Ship()] * 2, 2 * HOUR, seeds=[seed + 1 + number for seed in seeds], sea=gale, since_s=HOUR)
    for reference, voyage in zip(references, voyages, strict=True):
        known, later = (written(tmp_path / f"{n}.csv", t) for n, t in (("known", reference), ("later", voyage)))
        words = [str(later), "--reference", str(known), "--vessel", str(path), "--out", str(tmp_path), "--quiet"]
        assert main(["monitor", *words]) == 0
        told = json.loads((tmp_path / "monitor.json").read_text())
        assert told["alarms"] == []
        assert 0.0 < told["not_judged_for"]["wind_h"] <= told["not_judged_h"] < 0.5
        assert told["not_judged_for"]["depth_h"] == 0.0
        assert any("the measured wind was stronger than in" in sentence for sentence in told["verdict"])
        assert "the measured wind was stronger than in" in (tmp_path / "monitor.html").read_text()
