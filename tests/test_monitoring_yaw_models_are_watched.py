"""Yaw models are learnt from data alone, without bias by instruments, and watched by `expdesign monitor`."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.errors import FileError, InputError
from expdesign.monitoring import calibrate
from expdesign.monitoring.yaw import (
    YAW_MODELS,
    YawData,
    YawShip,
    estimate_yaw,
    estimate_yaw_by_instruments,
    halves_in_words,
    simulate_yaw,
    start_values,
    yaw_changes,
    yaw_grams,
)
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from naval_case import (
    BRISK,
    CALM,
    SHIP,
    Orders,
    exact,
    fleet,
    harbour,
    heavier,
    measured,
    measured_fleet,
    naval_csvs,
    turn,
)
from naval_ship import NOMINAL, YAW_TRUE
from yaw_detector import Detector, alarm_samples

FULL, SIMPLE = YAW_MODELS["full"], YAW_MODELS["simplified"]
REFERENCES = 4


@pytest.fixture(scope="module")
def departure() -> YawData:
    return exact(harbour(seconds=300.0, seed=1, step_s=0.5))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("naval")
    (path / "ship.toml").write_text(SHIP)
    parts = [path / f"reference-{number}.csv" for number in range(REFERENCES)]
    naval_csvs([*parts, path / "same.csv"], seconds=1500.0, seed=100)
    naval_csvs([path / "heavier.csv"], heavier(inertia=1.2), seconds=1500.0, seed=110)
    return path


def test_the_model_is_integrated_exactly_where_it_has_a_solution() -> None:
    """With u = 1 alone, I dr/dt = A r + tau: an exponential."""
    one, step_s = np.ones((1, 200)), 0.5
    data = YawData(
        sample_time_s=step_s, r=0.0 * one, sway_acceleration=0.0 * one, u=one, v=0.0 * one, phi=0.0 * one, moment=one
    )
    values = np.array([2.0, -1.0, 0.0, 0.0, 0.0])
    rates, slopes = simulate_yaw(SIMPLE, data, values)
    time_s = step_s * np.arange(200)
    np.testing.assert_allclose(rates[0], 1.0 - np.exp(-time_s / 2.0), atol=2e-5)
    np.testing.assert_allclose(slopes[0, :, 0], -time_s / 4.0 * np.exp(-time_s / 2.0), atol=5e-5)


def test_from_data_alone_the_search_ends_where_it_does_from_the_truth(departure: YawData) -> None:
    for model in (FULL, SIMPLE):
        blind = estimate_yaw(model, departure, start_values(model, departure))
        known = estimate_yaw(model, departure, YAW_TRUE)
        assert blind.parameters == pytest.approx(known.parameters, rel=1e-3)


def test_voyages_of_one_ship_share_its_parameters(departure: YawData) -> None:
    halves = [departure.part(slice(0, 300)), departure.part(slice(300, 600))]
    both = YawData(
        sample_time_s=0.5,
        **{
            name: np.concatenate([getattr(half, name) for half in halves])
            for name in ("r", "sway_acceleration", "u", "v", "phi", "moment")
        },
    )
    shared = estimate_yaw(FULL, both, YAW_TRUE, groups=np.zeros(2, dtype=int))
    assert shared.parameters.shape == (1, len(FULL.parameters))
    alone = estimate_yaw(FULL, halves[0], YAW_TRUE)
    apart = estimate_yaw(FULL, both, YAW_TRUE, groups=np.arange(2))
    np.testing.assert_allclose(apart.parameters[0], alone.parameters[0], rtol=1e-6)
    for name in ("I_r", "N_rr", "N_rv"):
        assert shared.of(name)[0] == pytest.approx(YAW_TRUE[name], rel=0.02)


def test_without_noise_instruments_and_output_error_agree(departure: YawData) -> None:
    crossed, plain = (f(FULL, departure, YAW_TRUE) for f in (estimate_yaw_by_instruments, estimate_yaw))
    for name in ("I_r", "A", "N_rr", "N_rv", "N_uv"):
        assert crossed.of(name)[0] == pytest.approx(plain.of(name)[0], rel=0.05)


@pytest.mark.slow
def test_instruments_take_away_the_bias_that_noisy_inputs_leave() -> None:
    voyage = harbour(seconds=500.0, seed=1, step_s=0.5)
    data = measured(voyage, count=40, seed=3, noise=5.0**-0.5, averaged=1)
    names = ("I_r", "M_v", "A")
    plain, crossed = estimate_yaw(FULL, data, YAW_TRUE), estimate_yaw_by_instruments(FULL, data, YAW_TRUE)
    found = np.isfinite(crossed.fit)
    assert found.mean() > 0.9
    unbiased = estimate_yaw_by_instruments(FULL, exact(voyage), YAW_TRUE)

    def bias(estimates: np.ndarray, truth: float) -> float:
        """In standard errors of the mean."""
        return float((estimates.mean() - truth) / (estimates.std(ddof=1) / np.sqrt(len(estimates))))

    assert max(abs(bias(plain.of(name), unbiased.of(name)[0])) for name in names) > 3.5
    for place, name in enumerate(FULL.parameters):
        if name in names:
            assert abs(bias(crossed.of(name)[found], unbiased.of(name)[0])) < 3.5
            held = np.abs(crossed.of(name) - unbiased.of(name)[0])[found] < 1.96 * crossed.std[found, place]
            assert held.mean() > 0.95 - 4.0 * np.sqrt(0.95 * 0.05 / found.sum())
    assert crossed.of("A")[found].std() > plain.of("A").std()  # which is the price


@pytest.mark.thorough
def test_stretches_show_the_changes_of_the_ship_that_sailed_them(folder: Path) -> None:
    vessel = load_vessel(folder / "ship.toml")
    ship = YawShip(model=FULL, vessel=vessel.model, parameters=YAW_TRUE)
    changes = yaw_changes(ship)
    record = load_records(folder / "heavier.csv", vessel_inputs=vessel.model.inputs)
    nominal = load_records(folder / "same.csv", vessel_inputs=vessel.model.inputs)
    grams = [yaw_grams(ship, data, changes, begins_s=[0.0], stretch_s=30.0) for data in (nominal, record)]
    reference, other = (calibrate(part) for part in grams)
    told = (other.baseline - reference.baseline)[0]
    assert told == pytest.approx(0.2 * 33.7 / 62.4 / 0.1, abs=5.0 * np.hypot(other.baseline_std[0], 0.1))


@pytest.mark.thorough
@pytest.mark.parametrize("model", ["yaw-full", "yaw-simplified"])
def test_the_watch_names_more_inertia_and_is_silent_otherwise(folder: Path, model: str) -> None:
    """By the share of her inertia: each model has one of its own, into which the simplified one takes what it lacks."""
    reference = [folder / f"reference-{number}.csv" for number in range(REFERENCES)]
    how = {"vessel": folder / "ship.toml", "reference": reference, "model": model, "size": 0.1}
    told = {}
    for name in ("same", "heavier"):
        out = folder / f"{model}-{name}"
        workflows.monitor([folder / f"{name}.csv"], out, **how)  # type: ignore[arg-type]
        told[name] = json.loads((out / "monitor.json").read_text())
    assert told["same"]["alarms"] == []
    alarm = told["heavier"]["alarms"][-1]
    assert alarm["effect"] == "yaw:I_r"
    notes = " ".join(told["same"]["notes"])
    learnt = re.search(r"learnt by output error.*?I_r (\S+) ", notes)
    assert learnt
    more = 0.2 * 33.7 / 62.4
    assert abs(alarm["value"] - more * float(learnt[1])) < 3.0 * alarm["std"] < 0.9 * more * float(learnt[1])
    assert "learnt by output error" in notes
    assert "The reference determines" in notes
    assert "By instruments" in notes
    assert "Both halves of the reference" in notes or "Not informative enough" in notes


@pytest.mark.thorough
def test_what_a_yaw_model_needs_is_asked_for(folder: Path, tmp_path: Path) -> None:
    lines = (folder / "same.csv").read_text().splitlines()
    place = lines[0].split(",").index("roll_rad")
    bare = tmp_path / "bare.csv"
    bare.write_text(
        "\n".join(",".join(cell for k, cell in enumerate(line.split(",")) if k != place) for line in lines) + "\n"
    )
    with pytest.raises((InputError, FileError), match=r"no roll_rad, which the yaw model full reads.*yaw-simplified"):
        workflows.monitor([bare], tmp_path / "out", vessel=folder / "ship.toml", learn_h=0.4, model="yaw-full")
    with pytest.raises(InputError, match="--model is yaw, expected one of vessel, yaw-full, yaw-simplified"):
        workflows.monitor([bare], tmp_path / "out", vessel=folder / "ship.toml", model="yaw")
    assert not (tmp_path / "out").exists()
    later = tmp_path / "later.csv"
    later.write_text("\n".join([lines[0], *(f"9{line}" for line in lines[2000:])]) + "\n")
    watched = tmp_path / "watched"
    reference = [folder / f"reference-{number}.csv" for number in range(REFERENCES)]
    workflows.monitor(
        [folder / "same.csv"], watched, vessel=folder / "ship.toml", reference=reference, model="yaw-full"
    )
    with pytest.raises(InputError, match="is of another model"):
        workflows.monitor([later], watched, vessel=folder / "ship.toml", resume=True, learn_h=0.4)


def test_halves_that_disagree_at_equal_fit_raise_the_alarm_of_poor_data() -> None:
    data = measured(turn(), count=1, seed=6, averaged=5, every=4)
    half = data.r.shape[1] // 2
    both = YawData(
        sample_time_s=data.sample_time_s,
        **{
            name: np.concatenate([getattr(data, name)[:, :half], getattr(data, name)[:, half : 2 * half]])
            for name in ("r", "sway_acceleration", "u", "v", "phi", "moment")
        },
    )
    poor = halves_in_words(estimate_yaw(FULL, both, YAW_TRUE, groups=np.arange(2)))
    assert "differ" in poor
    same = estimate_yaw(FULL, data, YAW_TRUE)
    twice = replace(same, parameters=np.tile(same.parameters, (2, 1)), std=np.tile(same.std, (2, 1)), fit=[90.0, 91.0])
    assert "within a factor of three, with fits of 90.0 and 91.0 %" in halves_in_words(twice)
    apart = replace(twice, parameters=same.parameters * np.array([[1.0], [4.0]]))
    assert halves_in_words(apart).startswith("Not informative enough: halves of the reference give I_r")


def inertial_difference(how: Orders, *, count: int) -> float:
    """Yaw rate of a ship with 10 % more moment of inertia less that of the nominal one, root mean square [rad/s]."""
    nominal, heavy = (
        fleet(hull, how, count=count, seed=0, seconds=150.0, step_s=0.5) for hull in (NOMINAL, heavier(inertia=1.1))
    )
    apart = [one.column("r") - other.column("r") for one, other in zip(nominal, heavy, strict=True)]
    return float(np.sqrt(np.mean(np.square(apart))))


@pytest.mark.thorough
def test_inertia_moves_the_yaw_rate_by_less_than_the_sum_of_the_thesis_counts() -> None:
    """Its constant d is 0.0025 rad/s; what inertia does grows with the changes of orders: detection rests on them."""
    calm, brisk = (inertial_difference(how, count=5) for how in (CALM, BRISK))
    assert calm < 0.0025 / 8.0
    assert 1.8 * calm < brisk < 0.0025 / 3.0


@pytest.mark.slow
def test_the_sum_of_the_thesis_finds_more_inertia_where_orders_change_often() -> None:
    """With its own constants, noise averaged over 7 samples: calm voyages are missed, others found."""
    constants = Detector(d=0.0025, l=3.5e-5, h=0.018)
    runs, missed = 20, {}
    for name, how in (("calm", CALM), ("brisk", BRISK)):
        learnt = measured_fleet(fleet(NOMINAL, how, count=2, seed=9000), seed=5000, averaged=7, every=4)
        priors = estimate_yaw(FULL, learnt, YAW_TRUE).parameters
        residuals = []
        for hull, seed in ((NOMINAL, 3000), (heavier(inertia=1.1), 4000)):
            data = measured_fleet(fleet(hull, how, count=runs, seed=0), seed=seed, averaged=7)
            residuals.append(np.concatenate([data.r - simulate_yaw(FULL, data, theta)[0] for theta in priors]))
        false, found = (np.isfinite(alarm_samples(constants, residual)).mean() for residual in residuals)
        assert false < 0.3
        missed[name] = 1.0 - found
    assert missed["brisk"] < 0.4
    assert missed["calm"] > 0.6


def test_sensitivities_are_the_differences_of_yaw_rates(departure: YawData) -> None:
    values = np.array([YAW_TRUE[name] for name in FULL.parameters])
    _, sensitivities = simulate_yaw(FULL, departure, values)
    for index, step in enumerate(1e-5 * values):
        moved = np.zeros_like(values)
        moved[index] = step
        higher, lower = (simulate_yaw(FULL, departure, values + sign * moved)[0] for sign in (1.0, -1.0))
        own = sensitivities[..., index]
        np.testing.assert_allclose((higher - lower) / (2.0 * step), own, atol=1e-5 * np.abs(own).max())
