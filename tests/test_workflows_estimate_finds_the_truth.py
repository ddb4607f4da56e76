"""From a measured file to parameters: instruments find the truth where least squares does not, and say so in files."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.assessment import EstimateOptions, assess, check_run
from expdesign.assessment.assess import preferred
from expdesign.assessment.misfit import autocorrelation
from expdesign.assessment.values import INSTRUMENTS
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.solve import Weighting
from expdesign.records import load_records
from expdesign.reduction import reduced
from expdesign.scenario import load_vessel
from expdesign.simulation import Environment
from expdesign.vessel import NUMPY, generalised_force
from measured_trials import (
    EULER,
    MODEL_SHIP,
    MODEL_SHIP_TRUE,
    TUG,
    TUG_TRUE,
    model_ship_commands,
    quiet,
    tug_commands,
    write_run,
)
from record_files import write_trial
from sample_files import outside
from vessel_files import KVLCC2, write_vessel

pytestmark = pytest.mark.usefixtures("undrawn")

TRUTH = dict(zip(MODEL_SHIP_TRUE.model.names, MODEL_SHIP_TRUE.model.parameters.tolist(), strict=True))
SENSORS = load_vessel(MODEL_SHIP).sensors


def estimates(folder: Path) -> dict[str, dict[str, object]]:
    return json.loads((folder / "estimate.json").read_text(encoding="utf-8"))


def errors_in_deviations(entry: dict[str, object], truth: dict[str, float]) -> np.ndarray:
    return np.array([(item["value"] - truth[name]) / item["std"] for name, item in entry["parameters"].items()])


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One noisy run to estimate from and one to test on, estimated by both default methods."""
    folder = tmp_path_factory.mktemp("trial")
    one = write_run(folder / "one.csv", MODEL_SHIP_TRUE, model_ship_commands(), **EULER)
    two = write_run(folder / "two.csv", MODEL_SHIP_TRUE, model_ship_commands(1000, seed=1), seed=1, **EULER)
    workflows.estimate([one], folder / "out", vessel=MODEL_SHIP, tests=[two], motion="euler")
    return folder / "out"


@pytest.mark.thorough
def test_instruments_find_the_truth_and_least_squares_does_not(trial: Path) -> None:
    found = estimates(trial)
    assert list(found) == ["ls", "iv"]
    assert np.abs(errors_in_deviations(found["iv"], TRUTH)).max() < 4
    assert np.abs(errors_in_deviations(found["ls"], TRUTH)).max() > 8


@pytest.mark.thorough
def test_a_trial_without_noise_gives_the_parameters_exactly(tmp_path: Path) -> None:
    path = write_run(tmp_path / "one.csv", quiet(MODEL_SHIP_TRUE), model_ship_commands(1500), **EULER)
    workflows.estimate([path], tmp_path / "out", vessel=MODEL_SHIP, motion="euler")
    for entry in estimates(tmp_path / "out").values():
        values = {name: item["value"] for name, item in entry["parameters"].items()}
        assert values == pytest.approx(TRUTH, rel=1e-5)  # the file holds ten digits
        assert min(entry["fit"]["estimation"]["one.csv"].values()) > 99.99


def decay_of(file: Path, method: str, motion: str) -> tuple[float, float]:
    """N_r and its standard deviation."""
    ship = load_vessel(MODEL_SHIP)
    record = reduced(load_records(file, vessel_inputs=ship.model.inputs), ship)
    options = EstimateOptions(methods=(method,), motion=motion, choice=INSTRUMENTS)
    found = assess(ship, record, options).methods[0].estimate
    return found.value("N_r"), float(found.std[found.names.index("N_r")])


def test_eulers_map_has_the_decay_that_samples_show_and_the_motion_its_own(tmp_path: Path) -> None:
    """Between samples the true yaw rate decays as exp(N_r t / T): Euler's map of it has exp(N_r) - 1 instead of N_r."""
    path = write_run(tmp_path / "one.csv", MODEL_SHIP_TRUE, model_ship_commands())
    (euler, euler_std), (motion, motion_std) = (decay_of(path, "iv", name) for name in ("euler", "continuous"))
    assert abs(euler - np.expm1(TRUTH["N_r"])) < 4 * euler_std
    assert abs(euler - TRUTH["N_r"]) > 4 * euler_std
    assert abs(motion - TRUTH["N_r"]) < 4 * motion_std


@pytest.mark.thorough
def test_without_noise_the_trapezoid_leaves_its_own_error_and_output_error_none(tmp_path: Path) -> None:
    """A decay a per sample shows as 2 tanh(a / 2) under the trapezoidal rule, 1 - exp(-a) under Euler's."""
    path = write_run(tmp_path / "one.csv", quiet(MODEL_SHIP_TRUE), model_ship_commands(1000), substeps=8)
    euler, trapezoid = (decay_of(path, "iv", name)[0] for name in ("euler", "continuous"))
    assert euler == pytest.approx(np.expm1(TRUTH["N_r"]), rel=1e-3)
    assert trapezoid == pytest.approx(2 * np.tanh(TRUTH["N_r"] / 2), rel=1e-3)
    exact, _ = decay_of(path, "oe", "continuous")
    assert exact == pytest.approx(TRUTH["N_r"], rel=2e-4)  # one Runge-Kutta step per sample


def test_white_velocity_noise_leaves_residuals_with_correlation_minus_a_half(trial: Path) -> None:
    correlation = estimates(trial)["iv"]["residuals"]["correlation_with_sample_before"]
    assert list(correlation.values()) == pytest.approx([-0.5] * 3, abs=0.08)


@pytest.mark.thorough
def test_runs_kept_apart_are_simulated_but_not_used(trial: Path, tmp_path: Path) -> None:
    found = estimates(trial)["iv"]
    assert list(found["fit"]["estimation"]) == ["one.csv"]
    assert list(found["fit"]["test"]) == ["two.csv"]
    workflows.estimate([trial.parent / "one.csv"], tmp_path, vessel=MODEL_SHIP, motion="euler")
    assert estimates(tmp_path)["iv"]["parameters"] == found["parameters"]


def test_what_the_noise_alone_would_cost_is_all_that_the_fit_lacks(trial: Path) -> None:
    """A perfect model leaves the noise, so its fit is 100 (1 - noise / spread of the measured output)."""
    fits = estimates(trial)["iv"]["fit"]["test"]["two.csv"]
    (batch,) = load_records(trial.parent / "two.csv").batches
    noise = (SENSORS.velocity_mps, SENSORS.velocity_mps, SENSORS.yaw_rate_radps)
    best = 100 * (1 - np.array(noise) / batch.velocity.std(axis=0))
    assert list(fits.values()) == pytest.approx(best.tolist(), abs=2.0)


def test_the_vessel_file_is_the_vessel_with_the_estimate(trial: Path) -> None:
    before, after = load_vessel(MODEL_SHIP), load_vessel(trial / "vessel-estimated.toml")
    found = estimates(trial)["iv"]
    assert found["in_vessel_file"]
    assert dict(zip(after.model.names, after.model.parameters.tolist(), strict=True)) == {
        name: item["value"] for name, item in found["parameters"].items()
    }
    assert dict(zip(after.model.names, after.model.parameter_std.tolist(), strict=True)) == {
        name: item["std"] for name, item in found["parameters"].items()
    }
    assert (after.actuators, after.sensors, after.model.terms) == (before.actuators, before.sensors, before.model.terms)


def test_what_is_held_fixed_stays_and_has_no_deviation(trial: Path, tmp_path: Path) -> None:
    workflows.estimate([trial.parent / "one.csv"], tmp_path, vessel=MODEL_SHIP, fixed=["X_u", "N_mu"], methods=["ls"])
    entry, before = estimates(tmp_path)["ls"], load_vessel(MODEL_SHIP).model
    held = {name: float(before.parameters[before.names.index(name)]) for name in ("X_u", "N_mu")}
    assert entry["held"] == held
    assert not set(held) & set(entry["parameters"])
    after = load_vessel(tmp_path / "vessel-estimated.toml").model
    assert {name: after.parameter_std[after.names.index(name)] for name in held} == {"X_u": 0, "N_mu": 0}


def test_generalised_forces_say_the_same_as_the_thrusters_they_come_from(tmp_path: Path) -> None:
    commands = tug_commands(600)
    path = write_run(tmp_path / "thrusters.csv", TUG_TRUE, commands, velocity=(1.7, 0.7, 0.0), **EULER)
    header, *rows = (line.split(",") for line in path.read_text(encoding="utf-8").splitlines())
    columns = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    signals = dict(zip(commands.names, commands.values.T, strict=True))
    forces = generalised_force(TUG_TRUE.actuators, signals, NUMPY)
    kept = {name: values for name, values in columns.items() if name[0] not in "na" or name == "north_m"}
    tau = dict(zip(("tau_x", "tau_y", "tau_psi"), forces, strict=True))
    other = write_trial(tmp_path / "forces.csv", kept | tau)
    for name, file in (("a", path), ("b", other)):
        workflows.estimate([file], tmp_path / name, vessel=TUG, methods=["ls"])
    one, two = (estimates(tmp_path / name)["ls"]["parameters"] for name in "ab")
    assert {n: i["value"] for n, i in one.items()} == pytest.approx({n: i["value"] for n, i in two.items()}, rel=1e-4)


WIND = Environment(wind_to=np.array([4.0, -3.0]))


def test_the_true_model_in_the_measured_wind_repeats_the_run(tmp_path: Path) -> None:
    path = write_run(
        tmp_path / "one.csv", quiet(TUG_TRUE), tug_commands(400), velocity=(1.7, 0.7, 0), environment=WIND, **EULER
    )
    (batch,) = load_records(path).batches
    windy = check_run(TUG_TRUE.model, batch, use="test", wind=True)
    still = check_run(TUG_TRUE.model, batch, use="test", wind=False)
    assert windy.fit_percent.min() > 99.9
    assert still.fit_percent.min() < 90


@pytest.mark.thorough
def test_wind_is_used_where_it_is_measured_and_modelled(tmp_path: Path) -> None:
    path = write_run(
        tmp_path / "one.csv", TUG_TRUE, tug_commands(600), velocity=(1.7, 0.7, 0), environment=WIND, **EULER
    )
    workflows.estimate([path], tmp_path / "out", vessel=TUG)
    found = estimates(tmp_path / "out")
    assert {"ls", "iv", "ls-air"} <= set(found)
    assert set(found["ls-air"]["parameters"]) - set(found["ls"]["parameters"]) == {"W_abs_u_u", "W_abs_v_v", "W_uv"}
    assert any("X_abs_u_u is the sum of X_abs_u_u and W_abs_u_u" in text for text in found["ls"]["warnings"])


def test_a_broken_excitation_condition_is_reported(tmp_path: Path) -> None:
    """Going ahead, then astern: u changes its sign within the run."""
    ahead, astern = model_ship_commands(800).values, model_ship_commands(800, seed=3, astern=True).values
    both = type(model_ship_commands(10))(
        sample_time_s=0.125, names=MODEL_SHIP_TRUE.model.inputs, values=np.concatenate([ahead, astern])
    )
    path = write_run(tmp_path / "one.csv", MODEL_SHIP_TRUE, both, **EULER)
    workflows.estimate([path], tmp_path / "out", vessel=MODEL_SHIP, methods=["ls"])
    (sentence,) = (text for text in estimates(tmp_path / "out")["ls"]["warnings"] if "excitation condition" in text)
    assert "X_abs_u_u" in sentence


def test_autocorrelation_is_the_mean_product_of_pairs_that_exist() -> None:
    rng = np.random.default_rng(0)
    batch = np.repeat([0, 1, 2], [40, 3, 57])
    step = np.concatenate([np.delete(np.arange(42), [7, 20]), np.arange(5, 8), np.arange(57)])
    values = rng.normal(size=(100, 2))
    found = autocorrelation(values, batch, step, lags=9)
    there = {(b, s): row for b, s, row in zip(batch.tolist(), step.tolist(), values, strict=True)}
    for lag in range(1, 10):
        pairs = [row * there[b, s + lag] for (b, s), row in there.items() if (b, s + lag) in there]
        assert found[lag] == pytest.approx(np.mean(pairs, axis=0) / (values**2).mean(axis=0))


@pytest.mark.outside
def test_free_running_tests_of_a_tanker_predict_runs_kept_apart(tmp_path: Path) -> None:
    folder = outside("kvlcc2-hsva-7m")
    used = [folder / f"zigzag_{name}.csv" for name in ("10_05", "15_05", "25_05")]
    vessel = write_vessel(tmp_path / "tanker.toml", KVLCC2)
    outcome = workflows.estimate(
        used, tmp_path / "out", vessel=vessel, mean="none", tests=[folder / "zigzag_20_10_p.csv"]
    )
    assert [path.name for path in outcome.files] == ["estimate.json", "vessel-estimated.toml", "estimate.html"]
    for entry in estimates(tmp_path / "out").values():
        assert min(entry["fit"]["test"]["zigzag_20_10_p.csv"].values()) > 75
    model = load_vessel(tmp_path / "out" / "vessel-estimated.toml").model
    assert model.names == load_vessel(vessel).model.names


def test_shares_of_progress_never_fall(tmp_path: Path) -> None:
    told: list[float] = []
    path = write_run(tmp_path / "one.csv", MODEL_SHIP_TRUE, model_ship_commands(500), **EULER)
    workflows.estimate(
        [path], tmp_path / "out", vessel=MODEL_SHIP, methods=["ls"], progress=lambda _, share: told.append(share)
    )
    assert all(a <= b for a, b in pairwise(told))
    assert told[-1] == 1.0


@pytest.mark.thorough
def test_the_mean_current_is_read_out_of_an_augmented_estimate(tmp_path: Path) -> None:
    current = Environment(current_to=np.array([0.2, -0.2]))
    path = write_run(
        tmp_path / "one.csv", TUG_TRUE, tug_commands(), velocity=(1.7, 0.7, 0), environment=current, **EULER
    )
    workflows.estimate([path], tmp_path / "out", vessel=TUG, methods=["iv-augmented", "ls"], motion="euler")
    found = estimates(tmp_path / "out")
    read = [found["iv-augmented"]["current_to"][name] for name in ("north_mps", "east_mps")]
    for item, truth in zip(read, (0.2, -0.2), strict=True):
        assert abs(item["value"] - truth) < 4 * item["std"] < 0.8
    assert found["ls"]["current_to"] is None
    assert found["ls"]["disturbances"] == []
    told = {item["of"]: item for item in found["iv-augmented"]["disturbances"]}
    assert set(told) == {"current", "current and wind in du/dt", "current and wind in dv/dt"}
    assert told["current"]["mean_mps"]["north"] == read[0]
    for felt in ("current and wind in du/dt", "current and wind in dv/dt"):
        for part in ("second_moments_m2ps2", "covariance_m2ps2"):
            assert all(item["std"] > 0 for item in told[felt][part].values())
    assert "Current and wind" in (tmp_path / "out" / "estimate.html").read_text(encoding="utf-8")


@pytest.mark.thorough
def test_blocks_asked_for_are_blocks_used(trial: Path, tmp_path: Path) -> None:
    """Every run a block of its own: the estimate is that of the library, and differs from one block for all."""
    files, ship = [trial.parent / f"{name}.csv" for name in ("one", "two")], load_vessel(MODEL_SHIP)
    workflows.estimate(files, tmp_path, vessel=MODEL_SHIP, methods=["iv"], mean="batch", blocks="batch", motion="euler")
    record = reduced(load_records(files, vessel_inputs=ship.model.inputs), ship)
    found = estimates(tmp_path)["iv"]["parameters"]
    for blocks, same in (("batch", True), ("one", False)):
        weighting = Weighting(mean="batch", blocks=blocks)
        own = estimate(record, ship.model, method="iv", settings=Settings(weighting=weighting))
        near = [found[name]["value"] == pytest.approx(own.value(name), rel=1e-6) for name in own.names]
        assert all(near) == same


def test_a_vessel_file_without_values_starts_from_least_squares(trial: Path, tmp_path: Path) -> None:
    """All parameters zero say nothing of the ship: the refined estimate is the same as from good values."""
    text = MODEL_SHIP.read_text(encoding="utf-8")
    head, _, rest = text.partition("[model.parameters]")
    zeros = "".join(f"{name} = 0.0\n" for name in TRUTH)
    (tmp_path / "zero.toml").write_text(f"{head}[model.parameters]\n{zeros}\n[sensors]{rest.partition('[sensors]')[2]}")
    workflows.estimate(
        [trial.parent / "one.csv"], tmp_path / "out", vessel=tmp_path / "zero.toml", methods=["iv"], motion="euler"
    )
    entry, usual = estimates(tmp_path / "out")["iv"], estimates(trial)["iv"]
    assert (entry["instruments"]["start"], usual["instruments"]["start"]) == ("ls", "nominal")
    assert any("all zero" in text for text in entry["warnings"])
    for name, item in entry["parameters"].items():
        assert abs(item["value"] - usual["parameters"][name]["value"]) < 0.1 * item["std"]


@pytest.mark.thorough
def test_an_unstable_estimate_does_not_get_into_the_vessel_file(trial: Path) -> None:
    """Of two estimates by instruments the first is spoilt: the second is chosen, and least squares where both are."""
    ship = load_vessel(MODEL_SHIP)
    record = load_records(trial.parent / "one.csv", vessel_inputs=ship.model.inputs)
    good = assess(ship, record, EstimateOptions(methods=("ls", "iv"))).methods
    spoilt = replace(good[1], runs=(replace(good[1].runs[0], simulated=None, problem="diverges"),))
    assert preferred(good) == 1
    assert preferred((good[0], spoilt, good[1])) == 2
    assert preferred((good[0], spoilt)) == 0
    assert preferred((spoilt,)) == 0
