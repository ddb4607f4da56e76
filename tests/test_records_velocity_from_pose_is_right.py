"""Differences and smoothing against closed forms, invariances, statistics, and the textbook recursions."""

from pathlib import Path

import numpy as np
import pytest

from expdesign.records import central_difference, load_records, smoothed_velocity
from expdesign.records.pose.motion import WEIGHT, smooth
from expdesign.records.pose.motion import _likeliest_ratio as likeliest_ratio
from record_files import SAMPLE_TIME_S, motion, write_trial

STEP = 0.5


def circle(u: float, v: float, r: float, count: int = 60) -> np.ndarray:
    """Pose of steady motion: velocity (u, v) turned at r from heading 0.3."""
    time = STEP * np.arange(count)
    heading = 0.3 + r * time
    s, c = (np.sin(heading) - np.sin(0.3)) / r, (np.cos(heading) - np.cos(0.3)) / r
    return np.stack([u * s + v * c, -u * c + v * s, heading], axis=-1)


def test_differences_of_a_circle_are_the_chord() -> None:
    u, v, r = 3.0, -0.4, 0.2
    chord = np.sin(r * STEP) / (r * STEP)
    found = central_difference(circle(u, v, r), STEP)
    assert found.shape == (58, 3)
    assert np.allclose(found, [chord * u, chord * v, r], rtol=1e-12)


def test_smoothing_of_a_straight_line_is_exact() -> None:
    time = STEP * np.arange(30)
    pose = np.stack([2 + 3 * time, 1 - 4 * time, 0.5 + 0 * time], axis=-1)
    c, s = np.cos(0.5), np.sin(0.5)
    assert np.allclose(smoothed_velocity(pose, STEP), [3 * c - 4 * s, -3 * s - 4 * c, 0.0], atol=1e-9)


@pytest.mark.parametrize("angle", [0.7, -2.5])
def test_velocity_does_not_depend_on_where_north_is(angle: float) -> None:
    rng = np.random.default_rng(1)
    pose = circle(3.0, -0.4, 0.1) + 0.1 * rng.standard_normal((60, 3))
    c, s = np.cos(angle), np.sin(angle)
    turned = np.column_stack([pose[:, :2] @ np.array([[c, s], [-s, c]]) + (100, -7), pose[:, 2] + angle])
    assert np.allclose(central_difference(turned, STEP), central_difference(pose, STEP), atol=1e-10)
    assert np.allclose(smoothed_velocity(turned, STEP), smoothed_velocity(pose, STEP), atol=1e-6)


def test_a_mirrored_track_has_mirrored_velocities() -> None:
    rng = np.random.default_rng(2)
    pose = circle(3.0, -0.4, 0.1) + 0.1 * rng.standard_normal((60, 3))
    mirror = np.array([1.0, -1.0, -1.0])
    for velocity in (central_difference, smoothed_velocity):
        assert np.allclose(velocity(pose * mirror, STEP), velocity(pose, STEP) * mirror, atol=1e-9)


def test_the_correction_removes_the_shrinkage_by_heading_noise() -> None:
    """E cos(e) of Gaussian e is exp(-var / 2); Ljungberg's doctoral thesis, (3.70)-(3.74)."""
    rng, std, count = np.random.default_rng(3), 0.5, 200_000
    pose = np.stack([3.0 * STEP * np.arange(count), np.zeros(count), std * rng.standard_normal(count)], axis=-1)
    shrunk = central_difference(pose, STEP)[:, 0].mean()
    error = 3.0 * np.sqrt(np.var(np.cos(std * rng.standard_normal(count))) / count)
    assert abs(shrunk - 3.0 * np.exp(-(std**2) / 2)) < 4 * error
    mended = central_difference(pose, STEP, heading_std_rad=std)[:, :2].mean(axis=0)
    assert np.abs(mended - (3.0, 0.0)).max() < 8 * error


def rauch_tung_striebel(values: np.ndarray, ratio: float) -> np.ndarray:
    """States (k, 2) by the textbook recursions with unit measurement variance and a very wide prior."""
    F, Q, H = np.array([[1.0, 1.0], [0.0, 1.0]]), ratio * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]), np.array([1.0, 0.0])
    state, P = np.zeros(2), 1e9 * np.eye(2)
    predicted, filtered = [], []
    for value in values:
        predicted.append((state, P))
        gain = P @ H / (H @ P @ H + 1.0)
        keep = np.eye(2) - np.outer(gain, H)
        state, P = state + gain * (value - H @ state), keep @ P @ keep.T + np.outer(gain, gain)
        filtered.append((state, P))
        state, P = F @ state, F @ P @ F.T + Q
    smoothed = [filtered[-1][0]]
    for (state, P), (ahead, P_ahead) in zip(filtered[-2::-1], predicted[:0:-1], strict=True):
        smoothed.append(state + P @ F.T @ np.linalg.solve(P_ahead, smoothed[-1] - ahead))
    return np.array(smoothed[::-1])


@pytest.mark.parametrize("kind", ["smooth", "rough"])
def test_the_banded_solution_is_that_of_the_recursions(kind: str) -> None:
    rng = np.random.default_rng(4)
    signal = np.sin(0.05 * np.arange(120)) if kind == "smooth" else np.cumsum(rng.standard_normal(120))
    values = signal + 0.1 * rng.standard_normal(120)
    position, rate = smooth(values[:, None], STEP)
    expected = rauch_tung_striebel(values, likeliest_ratio(values[:, None], None))
    assert np.allclose(position[:, 0], expected[:, 0], atol=1e-5)
    assert np.allclose(rate[:, 0] * STEP, expected[:, 1], atol=1e-5)


def test_the_weight_is_the_inverse_of_the_covariance_of_a_kick() -> None:
    assert np.allclose(WEIGHT @ [[1 / 3, 1 / 2], [1 / 2, 1]], np.eye(2), atol=1e-14)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("ratio", [1e-5, 1e-2, 10.0])
def test_the_ratio_of_a_random_walk_in_noise_is_found(ratio: float, known: bool) -> None:
    """200 runs would do better; the likelihood of 4000 samples gives the ratio within a factor of two."""
    rng, count, noise = np.random.default_rng(5), 4000, 0.3
    kicks = rng.multivariate_normal([0, 0], ratio * np.array([[1 / 3, 1 / 2], [1 / 2, 1]]), size=count)
    rate = np.cumsum(kicks[:, 1])
    walk = np.cumsum(np.concatenate([[0], rate[:-1]]) + kicks[:, 0])
    values = noise * (walk + rng.standard_normal(count))
    found = likeliest_ratio(values[:, None], noise if known else None)
    assert 0.5 < found / ratio < 2.0


def test_smoothing_beats_differences_under_noise() -> None:
    rng = np.random.default_rng(6)
    truth = motion(400)
    pose = np.stack([truth[name] for name in ("north_m", "east_m", "heading_rad")], axis=-1)
    velocity = np.stack([truth[name] for name in ("u_mps", "v_mps", "r_radps")], axis=-1)
    noisy = pose + np.array([0.5, 0.5, 0.02]) * rng.standard_normal(pose.shape)

    def error(found: np.ndarray) -> np.ndarray:
        return np.sqrt(np.mean((found - velocity[1:-1]) ** 2, axis=0))

    assert (error(smoothed_velocity(noisy, SAMPLE_TIME_S)[1:-1]) < 0.2 * error(central_difference(noisy, STEP))).all()


@pytest.mark.parametrize("method", ["difference", "smoothed"])
def test_derived_velocities_never_cross_a_gap(tmp_path: Path, method: str) -> None:
    """Two trials in one file, a gap between them, give what each gives alone."""
    rng, data = np.random.default_rng(7), motion()
    parts = [{n: v[part] for n, v in data.items()} for part in (slice(0, 33), slice(40, 80))]
    for part in parts:
        part["north_m"] = part["north_m"] + 0.1 * rng.standard_normal(len(part["north_m"]))
    whole = {name: np.concatenate([part[name] for part in parts]) for name in data}
    alone = [load_records(write_trial(tmp_path / f"{i}.csv", part), velocity=method) for i, part in enumerate(parts)]
    together = load_records(write_trial(tmp_path / "trial.csv", whole), velocity=method)
    for batch, single in zip(together.batches, alone, strict=True):
        assert np.array_equal(batch.velocity, single.batches[0].velocity)
        assert np.array_equal(batch.inputs, single.batches[0].inputs)
    trimmed = 1 if method == "difference" else 0
    assert [batch.first_row for batch in together.batches] == [2 + trimmed, 35 + trimmed]


def test_only_what_is_missing_is_derived(tmp_path: Path) -> None:
    data = motion()
    path = write_trial(tmp_path / "trial.csv", {name: values for name, values in data.items() if name != "r_radps"})
    (batch,) = load_records(path).batches
    assert np.array_equal(batch.velocity[:, 0], data["u_mps"][1:-1])
    expected = (data["heading_rad"][2:] - data["heading_rad"][:-2]) / (2 * SAMPLE_TIME_S)
    assert np.allclose(batch.velocity[:, 2], expected, rtol=1e-12)
    assert np.array_equal(batch.inputs[:, 0], data["n1_rps"][1:-1])
    assert load_records(path).notes == (
        "trial.csv: r comes from central differences of the pose, which the first and last sample of a batch lack",
    )


def test_a_track_that_goes_sideways_is_noted(tmp_path: Path) -> None:
    data = motion()
    names = ("time_s", "north_m", "east_m", "n1_rps")
    path = write_trial(tmp_path / "trial.csv", {n: data[n] for n in names} | {"heading_rad": data["heading_rad"] + 1.4})
    assert load_records(path).notes[-1].startswith("trial.csv: the ship moves sideways at 2 m/s and ahead at 0.434 m/s")
