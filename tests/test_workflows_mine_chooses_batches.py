"""`expdesign mine`: which recorded runs to estimate from again."""

import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from design_case import SCENARIOS, example_dictionary, random_matrices, vessel
from expdesign.cli import main
from expdesign.durations import best_subset
from expdesign.errors import InputError, NotInformative
from expdesign.export.files.text import record_csv
from expdesign.information.recorded import BatchInformation, recorded_information
from expdesign.records import load_records
from expdesign.signals import Batch, Record
from expdesign.simulation import CALM, Environment, simulate_ensemble
from expdesign.workflows.commands.mine import in_pieces, mine

pytestmark = pytest.mark.usefixtures("undrawn")

SHIP = SCENARIOS / "vessels" / "model-ship.toml"
FORCES = ("tau_x", "tau_y", "tau_psi")


def sailed(number: int, seed: int = 0, environment: Environment = CALM, *, noise: float = 1.0) -> Batch:
    """What the true model ship's sensors tell of one primitive, with so much of their noise."""
    ship = vessel("model-ship-true")
    own = {name: noise * getattr(ship.sensors, name) for name in ("velocity_mps", "yaw_rate_radps", "heading_rad")}
    primitive = example_dictionary("model-ship")[number]
    return simulate_ensemble(
        replace(ship, sensors=replace(ship.sensors, **own)),
        np.concatenate([primitive.commands.values, primitive.commands.values[-1:]]),
        runs=1,
        environment=environment,
        rng=np.random.default_rng([seed, number]),
        velocity=primitive.entry_velocity,
    ).batch(0)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Eight recorded runs, one in each file."""
    folder = tmp_path_factory.mktemp("runs")
    paths = [folder / f"run{number}.csv" for number in (0, 1, 4, 5, 7, 8, 9, 10)]
    for path in paths:
        path.write_text(record_csv([sailed(int(path.stem[3:]))]))
    return paths


def test_a_record_written_is_the_record_read(tmp_path: Path):
    batches = [sailed(number, environment=Environment(wind_to=np.array([3.0, 1.0]))) for number in (7, 10)]
    path = tmp_path / "both.csv"
    path.write_text(record_csv(batches))
    read = load_records(path, vessel_inputs=FORCES).batches
    assert len(read) == 2
    for one, other in zip(batches, read, strict=True):
        assert other.sample_time_s == pytest.approx(one.sample_time_s)
        np.testing.assert_allclose(other.velocity, one.velocity, atol=1e-8)
        np.testing.assert_allclose(other.inputs, one.inputs, rtol=1e-9)
        np.testing.assert_allclose(other.wind, one.wind, atol=1e-8)
        turned = (other.pose - one.pose)[:, 2]
        np.testing.assert_allclose(turned, turned[0], atol=1e-7)
        assert turned[0] / (2 * np.pi) == pytest.approx(round(turned[0] / (2 * np.pi)), abs=1e-7)


def test_pieces_are_the_batch_cut_up():
    batch = sailed(7)
    pieces = in_pieces(Record(batches=(batch,)), 9.0).batches
    assert len(pieces) == 4
    assert len({piece.name for piece in pieces}) == 4
    assert max(map(len, pieces)) - min(map(len, pieces)) <= 1
    for field in ("inputs", "velocity", "pose", "wind"):
        assert np.array_equal(np.concatenate([getattr(piece, field) for piece in pieces]), getattr(batch, field))
    assert in_pieces(Record(batches=(batch,)), 1e6).batches == (batch,)
    with pytest.raises(InputError, match="three samples"):
        in_pieces(Record(batches=(batch,)), 0.2)


@pytest.mark.parametrize("fault", [(1.0, 1.0, 1.1), (0.9, 0.9, 1.0)])
def test_a_run_whose_instruments_disagree_is_not_chosen(
    fault: tuple[float, float, float], files: list[Path], tmp_path: Path
) -> None:
    """It ranked first: what a fault adds to a motion counts as information. Where it is needed, it is taken."""

    def told(paths: list[Path], keep: int) -> dict[str, Any]:
        mine(paths, tmp_path / f"{keep}", vessel=SHIP, keep=keep)
        return json.loads((tmp_path / f"{keep}" / "mining.json").read_text())

    best = told(files, 3)
    wrong = next(name for name in best["chosen"] if name not in ("run0.csv", "run1.csv"))  # which sail straight ahead
    assert best["in_doubt"] == {}
    paths = [tmp_path / path.name for path in files]
    for path in paths:
        batch = sailed(int(path.stem[3:]), noise=0.03)
        own = np.array(fault) if path.name == wrong else np.ones(3)
        path.write_text(record_csv([replace(batch, velocity=batch.velocity * own)]))
    found = told(paths, 4)
    assert [*found["in_doubt"]] == [wrong]
    assert wrong not in found["chosen"]
    assert {row["name"] for row in found["batches"]} == {path.name for path in files} - {wrong}
    assert found["notes"][0].startswith("Left out of the choice, because instruments of the file disagree")
    assert wrong in found["notes"][0]
    assert len(told(paths, 8)["chosen"]) == 8


def test_the_chosen_are_those_of_largest_information_and_can_be_estimated_from(files: list[Path], tmp_path: Path):
    outcome = mine(files, tmp_path / "out", vessel=SHIP, keep=4)
    told = json.loads((tmp_path / "out" / "mining.json").read_text())
    record, ship = load_records(files, vessel_inputs=FORCES), vessel("model-ship")
    items = recorded_information(record, ship.model, ship.model.names)
    matrices = np.array([item.samples * item.bordered("complete") for item in items])
    if told["counts"].startswith("symmetric"):
        matrices = (matrices + matrices.transpose(0, 2, 1)) / 2
    scale = 1 / np.sqrt(np.abs(np.diagonal(matrices, axis1=1, axis2=2)).mean(axis=0))

    def value(picked: tuple[int, ...]) -> float:
        total = matrices[list(picked)].sum(axis=0) * np.outer(scale, scale)
        p = len(told["parameters"])
        schur = total[:p, :p] - total[:p, p:] @ np.linalg.solve(total[p:, p:], total[p:, :p])
        return float(np.linalg.slogdet(schur)[1])

    best = max(combinations(range(8), 4), key=value)
    assert told["chosen"] == [files[index].name for index in best]
    assert told["all_subsets_tried"]
    assert told["efficiency"] == pytest.approx(np.exp((value(best) - value(tuple(range(8)))) / 10), rel=1e-6)
    ranked = told["batches"]
    assert [row["rank"] for row in ranked] == list(range(1, 9))
    assert ranked[-1]["efficiency_up_to_here"] == pytest.approx(1.0)
    assert {row["name"] for row in ranked if row["chosen"]} == set(told["chosen"])
    assert outcome.summary["chosen"] == told["chosen"]
    again = load_records(tmp_path / "out" / "chosen.csv", vessel_inputs=FORCES).batches
    for index, batch in zip(best, again, strict=True):
        np.testing.assert_allclose(batch.velocity, record.batches[index].velocity, atol=1e-8)


def test_what_is_typed_is_what_is_done(files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    options = ["--keep", "5", "--piece", "12.5", "--fixed", "X_vr", "Y_ur", "--mean", "batch", "--json"]
    assert main(["mine", *map(str, files), "--vessel", str(SHIP), "--out", str(tmp_path / "out"), *options]) == 0
    told = json.loads((tmp_path / "out" / "mining.json").read_text())
    assert set(told["parameters"]) == set(vessel("model-ship").model.names) - {"X_vr", "Y_ur"}
    assert told["mean_subtraction"] == "batch"
    assert len(told["batches"]) == 3 * len(files)
    assert len(told["chosen"]) == 5
    assert json.loads(capsys.readouterr().out)["summary"]["chosen"] == told["chosen"]
    assert len(load_records(tmp_path / "out" / "chosen.csv", vessel_inputs=FORCES).batches) == 5


def test_without_a_definite_part_the_magnitude_of_the_determinant_decides():
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.trace(turn)) * -1.0  # the symmetric part of what is turned so is not positive definite
    items = [
        BatchInformation(
            name=f"{q}", seconds=20.0, samples=20, X=turn @ B[:3, :3], Y=np.zeros((3, 1)), Z=np.zeros((3, 1))
        )
        for q, B in enumerate(random_matrices(rng, count=7, parameters=3, outputs=1, samples=5))
    ]
    found = best_subset(items, ("a", "b", "c"), size=3, mean_subtraction="none")
    best = max(combinations(range(7), 3), key=lambda p: abs(np.linalg.det(sum(items[q].X for q in p))))
    assert not found.symmetric
    assert found.chosen == tuple(str(q) for q in best)


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        (["--keep", "9"], 2, "9 of 8 batches cannot be chosen"),
        (["--keep", "4", "--mean", "all"], 2, "--mean is all, expected one of"),
        (["--keep", "4", "--piece", "0"], 2, "--piece is 0, expected three samples"),
        (["--keep", "4", "--fixed", "X_uu"], 2, "X_uu"),
    ],
)
def test_wrong_options_give_one_line_and_no_files(files, tmp_path, capsys, options, status, words):
    out = tmp_path / "out"
    assert main(["mine", *map(str, files), "--vessel", str(SHIP), "--out", str(out), *options]) == status
    assert words in capsys.readouterr().err.strip().splitlines()[-1]
    assert not out.exists()


def test_parameters_without_information_are_named(files, tmp_path, capsys):
    straight = str(files[0])
    out = tmp_path / "out"
    assert main(["mine", straight, "--vessel", str(SHIP), "--keep", "1", "--out", str(out)]) == 3
    assert "N_mu" in capsys.readouterr().err
    assert not out.exists()


def noisy_batch(number: int, *, alike: bool, noise: float, rng: np.random.Generator) -> BatchInformation:
    """Moments of white regressors and instruments (200, 2, 3); the last is three times the second where alike."""
    instruments = rng.standard_normal((200, 2, 3)) + 0.3 * np.arange(3)
    regressors = instruments + noise * rng.standard_normal(instruments.shape)
    if alike:
        instruments[..., 2], regressors[..., 2] = 3 * instruments[..., 1], 3 * regressors[..., 1]
    X = np.einsum("kni,knj->ij", regressors, instruments) / 200
    means = {"Y": regressors.mean(axis=0).T, "Z": instruments.mean(axis=0).T}
    return BatchInformation(name=f"run{number}", seconds=200.0, samples=200, X=X, **means)


@pytest.mark.parametrize("mean", ["none", "batch", "complete"])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_parameters_that_no_batch_tells_apart_are_refused_and_named(mean: str, noise: float):
    """Batches were ranked by the rounding of a determinant that is zero."""
    rng = np.random.default_rng(5)
    apart, alike = ([noisy_batch(k, alike=same, noise=noise, rng=rng) for k in range(5)] for same in (False, True))
    assert len(best_subset(apart, ("a", "b", "c"), size=2, mean_subtraction=mean).chosen) == 2
    with pytest.raises(NotInformative, match=r"combinations: (b and c|c and b)") as refused:
        best_subset(alike, ("a", "b", "c"), size=2, mean_subtraction=mean)
    assert sorted(refused.value.parameters) == ["b", "c"]
