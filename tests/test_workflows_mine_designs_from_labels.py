"""`expdesign mine --labels`: a design from labelled data, beside random subsets of the same data."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from design_case import SCENARIOS, example_dictionary, vessel
from expdesign.cli import main
from expdesign.durations import pool_gains
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.solve import Weighting
from expdesign.export.files import vessel_toml
from expdesign.information import regressor_rows
from expdesign.information.recorded import by_label, recorded_information
from expdesign.records import load_records, row_labels
from expdesign.rehearsal import drawn_subsets, random_subsets, recorded_pieces, try_subsets
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import CALM
from expdesign.vessel import Sensors
from expdesign.workflows.steps.labelled import labelled_pieces
from labelled_trials import label_of, sailed, write_labelled
from sample_files import outside

pytestmark = pytest.mark.usefixtures("undrawn")

TRUTH = vessel("model-ship-true")
QUIET = replace(TRUTH, sensors=Sensors())
DICTIONARY = example_dictionary("model-ship")
FORCES = ("tau_x", "tau_y", "tau_psi")
NAMES = TRUTH.model.names


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two noise-free runs of every primitive, in calm water."""
    return write_labelled(tmp_path_factory.mktemp("quiet"), sailed(QUIET, DICTIONARY, count=2, integrator="euler"))


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs of every primitive, measured with noise."""
    ship = replace(TRUTH, sensors=Sensors(velocity_mps=0.1, yaw_rate_radps=0.1))
    return write_labelled(tmp_path_factory.mktemp("noisy"), sailed(ship, DICTIONARY, count=3, integrator="euler"))


@pytest.fixture(scope="module")
def nominal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The nominal ship's file."""
    path = tmp_path_factory.mktemp("ship") / "nominal.toml"
    path.write_text(vessel_toml(vessel("model-ship")))
    return path


def mined(folder: Path, ship: Path, out: Path, *more: str) -> int:
    return main(["mine", str(folder), "--vessel", str(ship), "--labels", "file", "--out", str(out), "-q", *more])


@pytest.mark.thorough
def test_information_of_labels_is_that_of_the_known_regressors(tmp_path: Path):
    """X = Y' of the terms at the recorded motion, by a path that knows neither files nor instruments."""
    ship = tmp_path / "true.toml"
    ship.write_text(vessel_toml(QUIET))
    batches = sailed(QUIET, DICTIONARY, count=1)  # by Runge-Kutta, as instruments of information are simulated
    folder = write_labelled(tmp_path / "data", batches)
    assert mined(folder, ship, tmp_path / "out", "--piece", "37", "--keep", "6", "--draws", "2") == 0
    told = json.loads((tmp_path / "out" / "dictionary.json").read_text())
    assert told["parameters"] == list(NAMES)
    assert [entry["name"] for entry in told["primitives"]] == [label_of(item) for item in DICTIONARY]
    for entry, batch in zip(told["primitives"], batches.values(), strict=True):
        used = 37 * 8 - 1  # pairs of samples in the piece
        motion = Trajectory(sample_time_s=0.125, pose=batch.pose[: used + 1], velocity=batch.velocity[: used + 1])
        rows = regressor_rows(
            QUIET.model, motion, Commands(sample_time_s=0.125, names=FORCES, values=batch.inputs[:used]), CALM
        )
        same = np.array([[a.equation == b.equation for b in QUIET.model.terms] for a in QUIET.model.terms])
        own = np.array([[a.equation == output for output in "uvr"] for a in QUIET.model.terms])
        expected = np.where(same, rows.T @ rows / used, 0.0)
        size = np.sqrt(np.diag(expected))
        size[size == 0] = 1.0
        np.testing.assert_allclose(
            np.array(entry["X"]) / np.outer(size, size), expected / np.outer(size, size), atol=2e-5
        )
        mean = own * rows.mean(axis=0)[:, None]
        np.testing.assert_allclose(np.array(entry["Y"]) / size[:, None], mean / size[:, None], atol=2e-5)
        np.testing.assert_allclose(np.array(entry["Z"]) / size[:, None], mean / size[:, None], atol=2e-5)


@pytest.mark.thorough
def test_shares_are_optimal_and_the_guarantee_holds(noisy: Path, nominal: Path, tmp_path: Path):
    """|det B| at the shares told is the value told, at least what is guaranteed, and no mixture near it is better."""
    out = tmp_path / "out"
    assert mined(noisy, nominal, out, "--piece", "18", "--keep", "20", "--draws", "2") == 0
    dictionary, told = (json.loads((out / f"{name}.json").read_text()) for name in ("dictionary", "durations"))
    blocks = [
        np.block([[np.array(entry["X"]), np.array(entry["Y"])], [np.array(entry["Z"]).T, np.eye(3)]])
        for entry in dictionary["primitives"]
    ]
    shares = np.array([entry["fraction"] for entry in told["primitives"]])

    def value(w: np.ndarray) -> float:
        total = np.tensordot(w, blocks, axes=1)
        size = np.sqrt(np.abs(np.diag(total)))
        return float(np.linalg.slogdet(total / np.outer(size, size))[1] + 2 * np.log(size).sum())

    assert shares.sum() == pytest.approx(1.0)
    assert told["log_det"] == pytest.approx(value(shares), abs=1e-6)
    guaranteed = told["certificate"]["guaranteed_log_det"]
    assert guaranteed is None or told["log_det"] >= guaranteed - 1e-9
    rng = np.random.default_rng(0)
    for _ in range(50):
        other = rng.dirichlet(np.ones(len(shares)))
        assert value(0.99 * shares + 0.01 * other) <= value(shares) + 1e-7
    gains = [entry["gain_beside_pool"] for entry in dictionary["primitives"]]
    assert sum(gains) == pytest.approx(0.0, abs=1e-6)
    assert told["primitives"][int(np.argmax(gains))]["fraction"] > 0


def test_a_gain_beside_the_pool_is_the_slope_of_the_log_determinant():
    rng = np.random.default_rng(3)
    matrices = rng.standard_normal((5, 4, 4)) + 4 * np.eye(4)
    gains, equal, step = pool_gains(matrices), np.full(5, 0.2), 1e-6
    for q in range(5):
        moved = (1 - step) * equal + step * np.eye(5)[q]
        slope = (np.linalg.slogdet(np.tensordot(moved, matrices, axes=1))[1]
                 - np.linalg.slogdet(matrices.mean(axis=0))[1]) / step  # fmt: skip
        assert gains[q] == pytest.approx(slope, abs=1e-4)
    ones = [np.diag(row) for row in np.eye(4)]  # none informs alone
    np.testing.assert_allclose(pool_gains(np.array(ones)), 0.0, atol=1e-12)
    assert np.isnan(pool_gains(np.array(ones[:3]))).all()


def test_score_ranks_where_no_manoeuvre_informs_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["score", str(SCENARIOS / "model-ship.toml"), "--out", str(tmp_path)]) == 0
    entries = json.loads((tmp_path / "dictionary.json").read_text())["primitives"]
    assert all(entry["log_det_alone"] is None for entry in entries)
    order = sorted(entries, key=lambda entry: -entry["gain_beside_pool"])
    lines = capsys.readouterr().out.splitlines()
    ranked = [line.split()[1] for line in lines if line.split()[:1] and line.split()[0].isdecimal()]
    assert ranked == [entry["name"] for entry in order]


@pytest.mark.parametrize("mean", ["none", "complete"])
def test_sums_over_pieces_give_the_estimate_of_their_data(noisy: Path, mean: str):
    files = sorted(noisy.glob("*.csv"))[::3]
    record, model = load_records(files, vessel_inputs=FORCES), vessel("model-ship").model
    pieces = recorded_pieces(record, ["a"] * len(files), model, parameters=NAMES, mean=mean)
    settings = Settings(weighting=Weighting(mean=mean), most_refinements=0)
    for subset in ((0, 1, 4, 5, 7, 8, 9), tuple(range(11))):
        chosen = replace(record, batches=tuple(record.batches[place] for place in subset))
        found = estimate(chosen, model, method="iv", settings=settings)
        np.testing.assert_allclose(pieces.estimate(subset), found.values, rtol=1e-7)


def test_without_noise_subsets_of_three_kinds_give_the_truth_and_simulate_without_error(quiet: Path):
    files = sorted(quiet.glob("*.csv"))
    record = load_records(files, vessel_inputs=FORCES)
    labels = [path.stem.partition("_")[0] for path in files]
    pieces = recorded_pieces(record, labels, vessel("model-ship").model, parameters=NAMES)
    kinds = dict.fromkeys(["tau01", "tau06", "tau11"], 1)
    found = try_subsets(pieces, "three kinds", drawn_subsets(labels, kinds, draws=4, rng=np.random.default_rng(0)))
    assert not found.degenerate.any()
    assert (found.norm < 1e-6).all()
    for subset in found.subsets:
        np.testing.assert_allclose(pieces.estimate(subset), TRUTH.model.parameters, rtol=1e-5)
    straight = [place for place, label in enumerate(labels) if label in ("tau01", "tau02")]
    alone = try_subsets(pieces, "straight", [tuple(straight)])
    assert alone.degenerate.all()
    assert np.isinf(alone.norm).all()


@pytest.mark.thorough
def test_optimised_subsets_are_degenerate_less_often_than_random_ones(noisy: Path, nominal: Path, tmp_path: Path):
    """By rate over draws: of 200 random ones about a fifth is degenerate, with a standard error of 3 %."""
    assert mined(noisy, nominal, tmp_path, "--piece", "37", "--keep", "3", "--draws", "200", "--seed", "1") == 0
    told = json.loads((tmp_path / "subsets.json").read_text())["designs"]
    assert told["optimised"]["degenerate"] < told["random"]["degenerate"] - 0.05
    medians = [told[name]["median_norm"] or np.inf for name in ("optimised", "random")]
    assert medians[0] < medians[1]


def test_random_subsets_prefer_no_label_and_designs_are_drawn_as_told():
    labels, rng = ["a"] * 8 + ["b"] * 2 + ["c"] * 5, np.random.default_rng(0)
    for subset in random_subsets(labels, 4, draws=50, rng=rng):
        assert len(set(subset)) == 4
    first = [labels[subset[0]] for subset in random_subsets(labels, 1, draws=3000, rng=rng)]
    for label in "abc":  # a share of 1/3 of 3000 has a standard error of 0.86 %
        assert first.count(label) / 3000 == pytest.approx(1 / 3, abs=0.035)
    for subset in drawn_subsets(labels, {"a": 2, "b": 2, "c": 0}, draws=20, rng=rng):
        assert [labels[place] for place in subset] == ["a", "a", "b", "b"]
        assert len(set(subset)) == 4
    assert set(random_subsets(labels, 15, draws=2, rng=rng)) == {tuple(range(15))}


def test_pieces_keep_to_one_label_of_the_column(tmp_path: Path):
    batch = next(iter(sailed(QUIET, DICTIONARY[3:4], count=1).values()))
    folder = write_labelled(tmp_path, {"run_1.csv": batch})
    lines = (folder / "run_1.csv").read_text().splitlines()
    names = ["zigzag"] * 100 + [""] * 20 + ["turn"] * 95 + ["zigzag"] * (len(lines) - 216)
    marked = [f"{lines[0]},manoeuvre", *(f"{line},{name}" for line, name in zip(lines[1:], names, strict=True))]
    (folder / "run_1.csv").write_text("\n".join(marked) + "\n")
    record = load_records([folder / "run_1.csv"], vessel_inputs=FORCES)
    assert not any("manoeuvre" in note for note in record.notes)
    found = row_labels(record, [folder / "run_1.csv"], "column")
    assert list(found[0]) == names
    pieces, labels = labelled_pieces(record, found, 4.0)  # 32 samples
    assert labels == ("zigzag",) * 3 + ("turn",) * 2 + ("zigzag",) * 2
    assert all(len(piece) == 32 for piece in pieces.batches)
    np.testing.assert_array_equal(pieces.batches[3].velocity, record.batches[0].velocity[120:152])


def test_moments_of_a_label_are_those_of_its_pieces_together(noisy: Path):
    record = load_records(sorted(noisy.glob("tau0[68]*.csv")), vessel_inputs=FORCES)
    model = vessel("model-ship").model
    items = recorded_information(record, model, NAMES)
    (one, other) = by_label(items, ["x"] * 2 + ["y"] * 4)
    np.testing.assert_allclose(one.X, np.mean([item.X for item in items[:2]], axis=0))
    np.testing.assert_allclose(other.Y, np.mean([item.Y for item in items[2:]], axis=0))
    assert one.samples + other.samples == sum(item.samples for item in items)


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        (["--keep", "6"], 2, "--labels needs --piece"),
        (["--keep", "6", "--piece", "0.2"], 2, "--piece is 0.2, expected three samples"),
        (["--keep", "6", "--piece", "900"], 2, "no stretch of one label is that long"),
        (["--keep", "0", "--piece", "9"], 2, "--keep is 0"),
        (["--keep", "999", "--piece", "9"], 2, "--keep is 999, expected at most the"),
        (["--keep", "6", "--piece", "9", "--mean", "batch"], 2, "--mean is batch, expected complete or none"),
        (["--keep", "6", "--piece", "9", "--draws", "1"], 2, "--draws is 1"),
        (["--keep", "6", "--piece", "9", "--labels", "column"], 2, "names no manoeuvre"),
        (["--keep", "6", "--piece", "9", "--labels", "colunm"], 2, "column"),
    ],
)
def test_wrong_options_give_one_line_and_no_files(quiet, nominal, tmp_path, capsys, options, status, words):
    out = tmp_path / "out"
    assert mined(quiet, nominal, out, *options) == status
    assert words in capsys.readouterr().err.strip().splitlines()[-1]
    assert not out.exists()


def test_labels_without_information_about_a_parameter_are_refused(quiet, nominal, tmp_path, capsys):
    straight = [str(path) for path in sorted(quiet.glob("tau0[12]_*.csv"))]
    arguments = ["--labels", "file", "--piece", "9", "--keep", "3", "--out", str(tmp_path / "out")]
    assert main(["mine", *straight, "--vessel", str(nominal), *arguments]) == 3
    assert "do not inform about every parameter" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.outside
def test_runs_of_a_tanker_become_a_dictionary_of_their_kinds(tmp_path: Path):
    from real_data_cases import POND, vessel_of

    folder = outside("esso-osaka-3m")
    files = [path for kind in ("random_06", "turn_14-Oct", "zigzag") for path in sorted(folder.glob(f"{kind}*"))[:3]]
    ship = tmp_path / "tanker.toml"
    ship.write_text(vessel_toml(vessel_of(POND)))
    options = ["--labels", "file", "--piece", "60", "--keep", "6", "--draws", "2", "--out", str(tmp_path / "out")]
    assert main(["mine", *map(str, files), "--vessel", str(ship), *options]) == 0
    told = json.loads((tmp_path / "out" / "dictionary.json").read_text())
    assert {entry["name"] for entry in told["primitives"]} == {"random", "turn", "zigzag"}
    counted = {entry["name"]: entry["pieces"] for entry in told["primitives"]}
    assert counted["random"] == sum((len(path.read_text().splitlines()) - 1) // 600 for path in files[:3])
