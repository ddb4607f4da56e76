"""The naval vessel, its pods and the yaw models agree with what the thesis says of them, and with each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expdesign.monitoring.yaw import (
    YAW_MODELS,
    YawData,
    estimate_yaw,
    halves_differ,
    simulate_yaw,
    term_budget,
)
from naval_case import exact, harbour, heavier, measured, rotation, turn
from naval_ship import YAW_TRUE, Hull, Pods, Voyage, pod_force, sail
from yaw_detector import Detector, alarm_samples, excitation_rank

FULL, SIMPLE = YAW_MODELS["full"], YAW_MODELS["simplified"]


@pytest.fixture(scope="module")
def turned() -> Voyage:
    return turn()


@pytest.fixture(scope="module")
def rotated() -> Voyage:
    return rotation()


@pytest.fixture(scope="module")
def departure() -> Voyage:
    return harbour(seconds=400.0, seed=1)


@pytest.mark.parametrize(
    ("speed", "flow", "ahead_kn", "aside_kn", "angle_deg"),
    [
        (60, 0, 55.57, 55.57, 90.0), (60, 5, 44.87, 95.24, 59.0), (60, 10, 34.16, 218.4, 50.0),
        (80, 0, 98.80, 98.80, 90.0), (80, 5, 84.52, 138.3, 65.5), (80, 10, 70.24, 260.7, 53.0),
    ],
)  # fmt: skip
def test_pods_push_as_tabulated(speed: float, flow: float, ahead_kn: float, aside_kn: float, angle_deg: float) -> None:
    angle = np.deg2rad(np.linspace(0.0, 100.0, 2001))
    along, across = pod_force(Pods(), flow, angle, speed)
    assert along[0] / 1e3 == pytest.approx(ahead_kn, rel=1e-3)
    assert across.max() / 1e3 == pytest.approx(aside_kn, rel=1e-3)
    assert np.rad2deg(angle[across.argmax()]) == pytest.approx(angle_deg, abs=0.6)


def test_the_ship_accelerates_and_turns_as_the_thesis_says(turned: Voyage) -> None:
    assert turned.column("u")[500] == pytest.approx(8.6, abs=0.05)
    u, v, _, r, phi, _ = turned.states[950]
    assert (u, v) == pytest.approx((8.31, -0.775), abs=0.01)
    assert np.rad2deg(r) == pytest.approx(1.74, abs=0.02)
    assert np.rad2deg(phi) == pytest.approx(-4.8, abs=0.1)
    assert np.rad2deg(turned.column("psi")[1500]) == pytest.approx(87.7, abs=0.2)


def test_without_drives_the_ship_loses_energy_and_mirrored_orders_give_the_mirrored_voyage() -> None:
    hull = Hull()
    drifting = sail(hull, np.zeros(300), np.zeros(300), start=np.array([5.0, 0.5, 0.0, 0.02, 0.05, 0.0]))
    speeds = drifting.states[:, :4]
    energy = 0.5 * np.einsum("ki,ij,kj->k", speeds, hull.inertia, speeds)
    assert energy[-1] < energy[0]
    port, starboard = (sail(hull, np.full(400, side * 0.2), np.full(400, 60.0)) for side in (1.0, -1.0))
    mirror = np.array([1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    assert starboard.states == pytest.approx(port.states * mirror, abs=1e-9)
    assert port.column("psi")[-1] < 0 < starboard.column("psi")[-1]


def test_the_full_model_with_true_parameters_is_the_yaw_row_of_the_ship(turned: Voyage) -> None:
    data = exact(turned)
    values = np.array([YAW_TRUE[name] for name in FULL.parameters])
    found = simulate_yaw(FULL, data, values)[0][0]
    assert np.abs(found - data.r[0]).max() < 2e-3 * np.abs(data.r[0]).max()


def shares(data: YawData, low: int, high: int) -> dict[str, float]:
    budget = {name: np.abs(moment[0, low:high]).mean() for name, moment in term_budget(FULL, data, YAW_TRUE).items()}
    whole = sum(budget.values())
    return {name: value / whole for name, value in budget.items()}


def test_what_contributes_in_a_turn_and_on_the_spot(turned: Voyage, rotated: Voyage) -> None:
    turning = shares(exact(turned), 500, 1500)
    assert sorted(turning, key=turning.__getitem__)[-3:] == ["N_rv", "N_uv", "A"]
    assert turning["M_v"] < 0.03
    assert turning["N_phiuu"] < 0.03
    spot = shares(exact(rotated), 100, 1000)
    assert sorted(spot, key=spot.__getitem__)[-2:] == ["N_rr", "N_rv"]
    assert spot["N_phiur"] + spot["N_phiuv"] + spot["N_phiuu"] < 0.02
    assert rotated.column("u").min() == pytest.approx(-1.88, abs=0.05)


def test_inertia_shows_on_the_spot_and_hardly_in_a_turn(turned: Voyage, rotated: Voyage) -> None:
    light = heavier(inertia=0.8)
    differences = [
        np.rad2deg(np.abs(changed.column("r") - whole.column("r")).max())
        for changed, whole in ((turn(light), turned), (rotation(light), rotated))
    ]
    assert differences[0] == pytest.approx(0.045, abs=0.01)
    assert differences[1] == pytest.approx(0.35, abs=0.03)
    assert turn(heavier(inertia=1.1)).column("psi")[-1] >= turned.column("psi")[-1] - 1e-6


@pytest.mark.thorough
def test_exact_data_give_the_true_parameters_and_a_wrong_force_scales_them_all(departure: Voyage) -> None:
    data = exact(departure)
    found = estimate_yaw(FULL, data, YAW_TRUE)
    assert found.fit[0] > 99.9
    for name in ("I_r", "A", "N_rr", "N_rv", "N_uv"):
        assert found.of(name)[0] == pytest.approx(YAW_TRUE[name], rel=0.03)
    scaled = replace(data, moment=1.25 * data.moment)
    again = estimate_yaw(FULL, scaled, {name: 1.25 * value for name, value in YAW_TRUE.items()})
    assert again.parameters == pytest.approx(1.25 * found.parameters, rel=1e-6)
    assert again.fit == pytest.approx(found.fit, abs=1e-6)


@pytest.mark.thorough
def test_fewer_parameters_have_more_bias_and_less_spread(departure: Voyage) -> None:
    data = measured(departure, count=12, seed=2, every=4)
    full, simple = (estimate_yaw(model, data, YAW_TRUE) for model in (FULL, SIMPLE))
    for name in ("A", "N_uv"):
        assert abs(simple.of(name).mean() - YAW_TRUE[name]) > abs(full.of(name).mean() - YAW_TRUE[name])
        assert simple.of(name).std() < full.of(name).std()
    spread = full.parameters.std(axis=0) / np.abs([YAW_TRUE[name] for name in FULL.parameters])
    assert FULL.parameters[int(spread.argmin())] == "I_r"
    assert FULL.parameters[int(spread.argmax())].startswith("N_phi")
    without_noise = estimate_yaw(SIMPLE, exact(departure), YAW_TRUE)
    assert abs(without_noise.of("N_uv")[0] / YAW_TRUE["N_uv"] - 1.0) > 0.2


@pytest.mark.thorough
def test_ten_per_cent_of_inertia_is_seen_and_of_mass_is_not(departure: Voyage) -> None:
    nominal = estimate_yaw(SIMPLE, measured(departure, count=6, seed=3, every=4), YAW_TRUE).of("I_r")
    heavy = estimate_yaw(
        SIMPLE,
        measured(harbour(heavier(inertia=1.1), seconds=400.0, seed=1), count=6, seed=4, every=4),
        YAW_TRUE,
    ).of("I_r")
    spread = np.hypot(nominal.std(), heavy.std())
    assert heavy.mean() - nominal.mean() > 1.5 * spread
    before = estimate_yaw(FULL, measured(departure, count=6, seed=3, every=4), YAW_TRUE).of("M_v")
    after = estimate_yaw(
        FULL, measured(harbour(heavier(mass=1.1), seconds=400.0, seed=1), count=6, seed=4, every=4), YAW_TRUE
    ).of("M_v")
    assert abs(after.mean() - before.mean()) < np.hypot(before.std(), after.std())


def test_damping_and_coriolis_are_one_unless_the_ship_goes_astern(turned: Voyage, rotated: Voyage) -> None:
    separate = YAW_MODELS["separate"]
    size = len(separate.parameters)
    assert turned.column("u").min() >= 0
    assert excitation_rank(separate, exact(turned), YAW_TRUE) == size - 1
    assert rotated.column("u").max() <= 1e-9
    assert excitation_rank(separate, exact(rotated), YAW_TRUE) == size - 1  # astern throughout
    assert excitation_rank(separate, exact(rotation(ahead=2.0)), YAW_TRUE) == size


@pytest.mark.thorough
def test_halves_of_a_poor_voyage_disagree_and_those_of_a_rich_one_do_not(turned: Voyage) -> None:
    rich = measured(harbour(seconds=500.0, seed=5), count=1, seed=6, every=4)
    poor = measured(turned, count=1, seed=6, every=4)
    known = [FULL.parameters.index(name) for name in ("I_r", "N_rv", "A")]
    differ = []
    for data in (rich, poor):
        half = data.r.shape[1] // 2
        halves = [estimate_yaw(FULL, data.part(part), YAW_TRUE) for part in (slice(0, half), slice(half, None))]
        differ.append(halves_differ(*halves)[0, known].sum())
    assert differ[0] == 0
    assert differ[1] > 0


@pytest.mark.parametrize(("falls", "std"), [(2.8e-5, 1.30e-3), (3.5e-5, 1.34e-3), (3e-5, 1.31e-3), (4e-5, 1.37e-3)])
def test_the_sum_of_the_thesis_neither_grows_nor_falls_at_the_noise_it_was_tuned_for(falls: float, std: float) -> None:
    tuned = Detector(d=0.0025, l=falls, h=0.02)
    assert abs(tuned.drift(std)) < 0.1 * falls
    assert tuned.drift(0.0025) > 0  # raw noise raises alarms by itself


def test_a_calibrated_sum_keeps_its_share_of_false_alarms_and_finds_a_larger_residual() -> None:
    rng = np.random.default_rng(7)
    quiet, other = 1e-3 * rng.standard_normal((2, 400, 500))
    tuned = Detector.calibrated(quiet, false_share=0.1)
    false = np.isfinite(alarm_samples(tuned, other)).mean()
    assert abs(false - 0.1) < 4.0 * np.sqrt(2 * 0.1 * 0.9 / 400)
    found = alarm_samples(tuned, 1.6 * other)
    assert np.isfinite(found).mean() > 0.9
