"""The estimate that predicts best what it has not seen is taken, and output error never loses to least squares."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.assessment import EstimateOptions, assess
from expdesign.assessment.ahead import TRIAL_LENGTHS, Ahead, by_run, missed
from expdesign.assessment.held_out import (
    FAR_WORSE,
    Candidate,
    Found,
    HeldOut,
    certainly_worse,
    folds,
    held_out,
    ranked,
    reason,
    stay_bounded,
)
from expdesign.cli import main
from expdesign.errors import NotInformative
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate, method_named
from expdesign.estimation.output_error import minimise
from expdesign.estimation.replay import Integration
from expdesign.records import load_records
from expdesign.reduction import averaged, samples_of_a_mean
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.vessel import Actuator, Limit, Missed, Sensors, Term, Vessel, VesselModel
from measured_trials import EULER, MODEL_SHIP, MODEL_SHIP_TRUE, model_ship_commands, quiet, write_run
from sample_files import outside

DECAY, GAIN = -0.15, 0.02
NOISE = 2e-4
RK4 = Integration("rk4", 2)


def yaw_ship(*, length_m: float = 20.0) -> Vessel:
    """First-order yaw."""
    terms = (Term("r", "N_r", "r"), Term("r", "N_d", "rudder1"))
    rudder = Actuator(kind="rudder", number=1, limits=(Limit(low=-0.7, high=0.7),))
    model = VesselModel(
        terms=terms,
        parameters=np.array([DECAY, GAIN]),
        parameter_std=np.zeros(2),
        form="continuous",
        sample_time_s=1.0,
        actuators=(rudder,),
    )
    return Vessel(
        name="yaw", length_m=length_m, beam_m=4.0, draught_m=2.0, sample_time_s=1.0, model=model,
        sensors=Sensors(yaw_rate_radps=NOISE),
    )  # fmt: skip


def yaw_run(
    seed: int, *, samples: int = 240, force: float = 0.0, white: float = 0.0, noise: float = NOISE, step_s: float = 1.0
) -> Batch:
    """The closed-form motion under held rudders, with a slow force of 60 s memory or a white one, and sensor noise."""
    rng = np.random.default_rng(seed)
    rudder = np.repeat(rng.uniform(-0.5, 0.5, samples), rng.integers(8, 30, samples))[:samples]
    kept, slow = np.exp(DECAY * step_s), np.exp(-step_s / 60.0)
    r, push = np.zeros(samples), 0.0
    for k in range(samples - 1):
        push = slow * push + np.sqrt(1 - slow**2) * force * rng.standard_normal()
        r[k + 1] = kept * r[k] + (kept - 1) / DECAY * (GAIN * rudder[k] + push) + white * rng.standard_normal()
    velocity = np.stack([np.full(samples, 3.0), np.zeros(samples), r + noise * rng.standard_normal(samples)], axis=1)
    return Batch(
        name=f"run {seed}", sample_time_s=step_s, input_names=("rudder1",), inputs=rudder[:, None], velocity=velocity
    )


def test_means_of_what_is_summed_up_are_driven_by_the_averaged_inputs() -> None:
    """dr = b times the input: exactly so, whatever the inputs are; the last mean has no successor."""
    inputs = np.random.default_rng(1).normal(size=(103, 2))
    states = np.concatenate([np.zeros((1, 2)), np.cumsum(inputs, axis=0)])[:-1]
    velocity = np.column_stack([states, states[:, 0]])
    batch = Batch(name="b", sample_time_s=0.1, input_names=("a", "b"), inputs=inputs, velocity=velocity)
    (found,) = averaged(Record(batches=(batch,)), 5).batches
    assert found.sample_time_s == pytest.approx(0.5)
    assert len(found) == 20
    rises = 5 * found.inputs[:-1]  # of five samples
    np.testing.assert_allclose(np.diff(found.velocity[:, :2], axis=0), rises, rtol=0, atol=1e-12)


def test_a_gap_costs_its_own_mean_only_and_interpolated_readings_count_as_gaps() -> None:
    rows = np.random.default_rng(2).normal(size=(40, 3))
    lost, between = rows.copy(), np.zeros((40, 3))
    lost[10:18, 1] = np.nan
    between[20:30, 2] = 1.0
    batch = Batch(
        name="b", sample_time_s=0.1, input_names=("a",), inputs=rows[:, :1], velocity=lost, interpolated=between
    )
    (found,) = averaged(Record(batches=(batch,)), 10).batches
    assert np.isnan(found.velocity).tolist() == [[False] * 3, [False, True, False], [False, False, True], [False] * 3]
    np.testing.assert_allclose(found.velocity[0], rows[:10].mean(axis=0))


@pytest.mark.parametrize("step_s", [0.02, 0.1, 1.0])
def test_as_many_samples_are_averaged_as_a_ship_is_slow(step_s: float) -> None:
    """A tenth of the time in which she sails her length, and never over a second."""
    samples = round(120 / step_s)
    record = Record(batches=(yaw_run(1, samples=samples, step_s=step_s, noise=0.0),))
    for length_m, mean_s in ((3.2, 0.1), (300.0, 1.0)):
        assert samples_of_a_mean(record, length_m) == max(1, int(mean_s / step_s + 1e-9)), length_m


def test_predictions_are_those_of_the_closed_form() -> None:
    """From a measured state r the yaw rate decays as exp(a t) towards where the held rudder leads."""
    ship, runs = yaw_ship(), [yaw_run(seed, samples=97, noise=0.002) for seed in (3, 4)]
    models = [ship.model.with_parameters({"N_r": DECAY * factor}) for factor in (1.0, 1.4)]
    found = Ahead(ship.model, runs, wind=False, integration=RK4).shares(models)
    for own, batch, factor in zip(found[:, 0], runs, (1.0, 1.4), strict=True):
        a, r, d = DECAY * factor, batch.velocity[:, 2], batch.inputs[:, 0]
        errors = []
        for first in (0, 30, 60):
            x = r[first]
            errors.append(0.0)
            for k in range(first, first + 30):
                x = np.exp(a) * x + (np.exp(a) - 1) / a * GAIN * d[k]
                errors.append(x - r[k + 1])
        assert own == pytest.approx(np.sqrt(np.mean(np.square(errors))) / r.std(), rel=1e-4)


def test_what_a_model_misses_is_the_share_of_its_wrong_gain() -> None:
    """Steady turns: from the measured rate r to 1.2 r as 1 - exp(a t); speeds that decay twice as fast as they should.

    Over six lengths each the way missed and the heading missed are sums of these, of all windows together.
    """
    gain, decay, step_s, length_m = 0.02, -0.5, 0.1, 5.0
    terms = (Term("u", "X_u", "u"), Term("r", "N_r", "r"), Term("r", "N_d", "rudder1"))
    true = replace(yaw_ship().model, terms=terms, parameters=[-0.01, decay, gain], parameter_std=np.zeros(3))
    wrong = true.with_parameters({"X_u": -0.02, "N_d": 1.2 * gain})
    time = step_s * np.arange(901)
    surge = np.exp(-0.01 * time)
    batches = [
        Batch(
            name=f"turn {angle}", sample_time_s=step_s, input_names=("rudder1",), inputs=np.full((901, 1), angle),
            velocity=np.column_stack([surge, 0 * time, np.full(901, -gain / decay * angle)]),
        )
        for angle in (0.2, -0.4)
    ]  # fmt: skip
    found = missed([wrong, wrong], batches, length_m=length_m, wind=False, integration=RK4)
    assert found is not None
    last_s = TRIAL_LENGTHS * length_m / float(np.sqrt(np.mean(surge**2)))
    count = round(last_s / step_s) + 1
    inside = step_s * np.arange(count)
    firsts = range(0, 901 - count + 1, count - 1)
    ways = [surge[first : first + count].sum() for first in firsts]
    fewer = [np.sum(surge[first] * (np.exp(-0.02 * inside) - np.exp(-0.01 * inside))) for first in firsts]
    assert found.way_share == pytest.approx(np.linalg.norm(fewer) / np.linalg.norm(ways), rel=1e-3)
    assert found.turn_share == pytest.approx(0.2 * np.mean(1 - np.exp(decay * inside)), rel=1e-3)
    mad = true.with_parameters({"X_u": 40.0, "N_r": 40.0})
    with np.errstate(all="ignore"):
        assert missed([mad, None], batches, length_m=length_m, wind=False, integration=RK4) == Missed(
            way_share=1.0, turn_share=1.0
        )
    assert missed([None, None], batches, length_m=length_m, wind=False, integration=RK4) is None


@pytest.mark.parametrize("runs", [1, 2, 3, 4, 11])
def test_every_sample_is_left_out_once_and_never_used_for_its_own_prediction(runs: int) -> None:
    batches = tuple(yaw_run(seed, samples=50) for seed in range(runs))
    seen = []
    for rest, apart in folds(Record(batches=batches)):
        seen += [batch.velocity for batch in apart.batches]
        used = {row.tobytes() for batch in rest.batches for row in batch.velocity}
        if runs > 1:  # the rest of a run would tell what no other run is told
            assert not {batch.name for batch in rest.batches} & {batch.name for batch in apart.batches}
        assert not used & {row.tobytes() for batch in apart.batches for row in batch.velocity}
        assert used
    assert sum(map(len, seen)) == 50 * runs


def test_a_run_that_is_most_of_the_data_is_cut() -> None:
    """Left out whole, it would leave too little."""
    record = Record(batches=(yaw_run(1, samples=240), yaw_run(2, samples=40)))
    for rest, apart in folds(record):
        assert sum(map(len, rest.batches)) > 1.5 * sum(map(len, apart.batches))


@pytest.mark.parametrize("steepest", [0.9, 1.1])
@pytest.mark.parametrize("most", [0.35, 0.7])
def test_a_model_that_runs_away_with_the_rudder_hard_over_goes_last(steepest: float, most: float) -> None:
    """dr = -a r + c |r| r + g d has a steady turn only where c < a^2 / (4 g d); the data lay half of the rudder."""
    ship = yaw_ship()
    terms = (*ship.model.terms, Term("r", "N_rr", "abs(r)*r"))
    rudder = Actuator(kind="rudder", number=1, limits=(Limit(low=-most, high=most),))
    model = replace(
        ship.model, terms=terms, parameters=np.zeros(3), parameter_std=np.zeros(3), actuators=(rudder,)
    )  # fmt: skip
    ship = replace(ship, model=model)
    c = steepest * DECAY**2 / (4 * GAIN * most)
    models = [model.with_parameters({"N_r": DECAY, "N_d": GAIN, "N_rr": value}) for value in (0.0, c)]
    run = yaw_run(3)
    batch = replace(run, inputs=run.inputs * 0.3 / np.abs(run.inputs).max())
    found = stay_bounded(models, ship, (batch,), RK4)
    assert found == [True, steepest < 1]
    held = [
        HeldOut(
            method=method_named("oe"),
            horizon_s=None,
            outputs=("r",),
            shares=np.array([share]),
            unseen=True,
            bounded=own,
        )
        for share, own in zip((0.3, 0.2), found, strict=True)
    ]
    assert ranked(held)[0] == (0 if steepest > 1 else 1)


@pytest.mark.parametrize(
    ("shares", "best"),
    [
        ({"ls": 0.30, "iv": 0.31, "oe": 0.35}, "ls"),
        ({"ls": 0.300, "iv": 0.305, "oe": 0.35}, "iv"),
        ({"ls": 0.300, "iv": 0.31, "oe": 0.301}, "oe"),
        ({"ls": 0.5, "iv": float("nan"), "oe": 0.9}, "ls"),
    ],
)
def test_the_least_error_decides_and_of_equal_ones_the_least_bias(shares: dict[str, float], best: str) -> None:
    found = [
        HeldOut(method=method_named(name), horizon_s=None, outputs=("r",), shares=np.array([share]), unseen=True)
        for name, share in shares.items()
    ]
    assert found[ranked(found)[0]].method.name == best


def test_an_estimate_that_does_not_explain_its_own_runs_goes_last_and_the_reason_says_so() -> None:
    """From three runs of four it predicts the fourth well; from all four it came out with a tenth of the damping."""
    ship, record = yaw_ship(), Record(batches=tuple(yaw_run(seed) for seed in range(4)))
    true, lost = (Found(model=ship.model.with_parameters({"N_r": DECAY * share})) for share in (1.0, 0.1))
    near = Found(model=ship.model.with_parameters({"N_r": DECAY * 1.1}))
    candidates = [
        Candidate(method=method_named(name), horizon_s=None, found=found, wind=False, again=lambda _, own=again: own)
        for name, found, again in (("iv", lost, true), ("ls", near, near))
    ]
    found = held_out(record, candidates, ship=ship, seen_as=lambda own: own, integration=RK4)
    assert found[0].share < found[1].share
    assert [item.explains for item in found] == [False, True]
    assert ranked(found) == [1, 0]
    assert "iv with" in reason(found, "ls", ())
    assert "its estimate from all runs predicts even these" in reason(found, "ls", ())
    assert "its estimate from all runs predicts even these" in reason(found[:1], "iv", ())  # nothing else to take


def of_runs(name: str, horizon_s: float | None, errors: np.ndarray) -> HeldOut:
    """Errors of one output in runs."""
    share = np.exp(np.log(errors).mean(keepdims=True))
    return HeldOut(
        method=method_named(name), horizon_s=horizon_s, outputs=("r",), shares=share, unseen=True,
        of_runs=np.log(errors),
    )  # fmt: skip


@pytest.mark.parametrize("runs", [2, 3, 6])
def test_of_methods_that_predict_alike_one_is_certainly_worse_as_rarely_as_the_interval_says(runs: int) -> None:
    """One end of 95 %: 2.5 % of draws, of however few runs; all errors vary by 30 %."""
    rng, count = np.random.default_rng(runs), 2000
    drawn = 0.1 * np.exp(0.3 * rng.standard_normal((count, 2, runs)))
    worse = [certainly_worse(of_runs("oe", 30.0, one), of_runs("iv", None, other)) for one, other in drawn]
    far = (np.log(drawn[:, 0]).mean(axis=1) - np.log(drawn[:, 1]).mean(axis=1) > np.log(2.0)).mean()
    assert np.mean(worse) <= 0.025 + far + 3 * np.sqrt(0.025 / count)


@pytest.mark.parametrize(("runs", "best"), [(1, "oe"), (2, "oe"), (8, "iv")])
def test_what_makes_the_deciding_error_least_goes_first_until_runs_tell_otherwise(runs: int, best: str) -> None:
    """A third worse on average, more in some runs than in others."""
    size = np.exp(np.random.default_rng(0).standard_normal(runs))
    found = [
        of_runs("iv", None, 0.1 * size), of_runs("oe", 10.0, 0.11 * size),
        of_runs("oe", 30.0, 0.1 * size * np.exp(0.3 + 0.1 * (-1.0) ** np.arange(runs))),
    ]  # fmt: skip
    first, *others = [found[place] for place in ranked(found)]
    assert first.method.name == best
    assert {item.label for item in others[:2]} >= {"oe over 10 s"}
    assert ("do not tell from chance" in reason(found, first.label, ())) == (best == "oe")
    far = [found[0], of_runs("oe", 30.0, 0.21 * size)]
    assert ranked(far) == [0, 1]


@pytest.mark.parametrize("own", [(True, True), (True, False), (False, True), (False, False)])
@pytest.mark.parametrize("fault", ["explains", "bounded"])
@pytest.mark.parametrize(
    ("times", "first"),
    [
        ((0.7, 0.7, 0.7), "oe"),  # better in every run
        ((1.5, 1.5, 1.5), "ls"),  # worse in every run
        ((1.21, 1.21, 2.65), "oe"),  # lost by one of three: the Mariner's circles tell nothing of her zig-zag
        ((1.2, 1.2, 8.0), "ls"),  # by so much that the mean is over twice as large
        ((1.5, 1.4, 1.6, 1.5, 1.4, 1.6), "ls"),  # worse for certain
    ],
)
def test_no_unsound_estimate_goes_first_and_few_runs_are_no_reason_against_output_error(
    times: tuple[float, ...], first: str, fault: str, own: tuple[bool, bool]
) -> None:
    """Output error's errors are so many times those of least squares, whichever of them has a fault, at every size."""
    for size in (0.001, 0.05, 0.4):
        found = [of_runs("oe", 30.0, size * np.array(times)), of_runs("ls", None, size * np.ones(len(times)))]
        found = [replace(item, **{fault: fine}) for item, fine in zip(found, own, strict=True)]
        least = "oe" if found[0].share < found[1].share else "ls"  # of two with faults
        expected = {(True, True): first, (True, False): "oe", (False, True): "ls", (False, False): least}[own]
        assert found[ranked(found)[0]].method.name == expected
        assert found[::-1][ranked(found[::-1])[0]].method.name == expected  # in whatever order they are asked for


@pytest.mark.parametrize("lacking", [None, 0, 1, 2])
@pytest.mark.parametrize(("wrong", "first"), [(4.0, "ls"), (2.5, "oe")])
def test_a_run_that_a_method_cannot_do_without_does_not_make_its_losses_look_like_chance(
    lacking: int | None, wrong: float, first: str
) -> None:
    """Worse in every run that it predicts is worse for certain, whether or not the others always give an estimate."""
    ship, record = yaw_ship(), Record(batches=tuple(yaw_run(seed) for seed in range(3)))
    own, near = (Found(model=ship.model.with_parameters({"N_r": DECAY * factor})) for factor in (wrong, 2.5))

    def again(rest: Record) -> Found:
        if lacking is not None and f"run {lacking}" not in {batch.name for batch in rest.batches}:
            raise NotInformative("the rest tells too little")
        return own

    candidates = [
        Candidate(method=method_named("oe"), horizon_s=30.0, found=own, wind=False, again=again),
        Candidate(method=method_named("ls"), horizon_s=None, found=near, wind=False, again=lambda _: near),
    ]
    found = held_out(record, candidates, ship=ship, seen_as=lambda own: own, integration=RK4)
    assert found[0].share < FAR_WORSE * found[1].share  # a factor does not decide
    assert found[ranked(found)[0]].method.name == first


def test_pieces_of_one_run_are_no_more_runs() -> None:
    shares = np.array([[0.1, np.nan], [0.4, np.nan], [0.3, np.nan]])
    np.testing.assert_allclose(np.exp(by_run(shares, ("a", "a", "b"))), [0.2, 0.3])


def test_starts_of_stretches_stay_within_the_sensors_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """A force that nobody recorded, a hundred times the noise: starts that answer it would hide what is lacking."""
    ends = []
    search = minimise.minimised

    def kept(problem, *args, **how):
        values, starts = search(problem, *args, **how)
        ends.append((problem, starts))
        return values, starts

    monkeypatch.setattr(minimise, "minimised", kept)
    ship = yaw_ship()
    record = Record(batches=tuple(yaw_run(seed, force=2e-3) for seed in (5, 6)))
    settings = Settings(integration=RK4, quadrature="trapezoid", horizon_s=30.0, sensors=ship.sensors)
    estimate(record, ship.model, method="oe", settings=settings)
    problem, starts = ends[-1]
    moved = np.abs(starts - problem.measured[0]) / NOISE
    assert problem.weights[0] ** -0.5 > 10 * NOISE  # what is left is no noise of the sensors
    assert moved.max() < 4.0


def test_with_noise_of_the_sensors_alone_starts_are_estimated_as_well_as_the_data_allow() -> None:
    """Maximum likelihood: no weight beside that of any other sample."""
    ship, ends = yaw_ship(), []
    record = Record(batches=tuple(yaw_run(seed, noise=0.003) for seed in (7, 8)))
    build = minimise.build_problem
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(minimise, "build_problem", lambda *args: ends.append(build(*args)) or ends[-1])
        found = estimate(record, ship.model, method="oe", settings=Settings(integration=RK4, quadrature="trapezoid"))
    assert found.residuals.std[0] == pytest.approx(0.003, rel=4 / np.sqrt(2 * 480))
    problem = replace(ends[-1], weights=found.residuals.std**-2.0)
    assert problem.weight[0].max() == pytest.approx(problem.weight[1].max(), rel=0.3)  # third differences of 480


@pytest.mark.thorough
@pytest.mark.parametrize("force", [0.0, 2e-3])
def test_an_unseen_run_is_predicted_as_well_as_by_least_squares(force: float) -> None:
    """Judged by runs that no part of the program has seen; the noise is a tenth of the motion."""
    ship, gains = yaw_ship(), []
    for seed in range(0, 24, 4):
        used, apart = (tuple(yaw_run(100 + seed + k, force=force, noise=0.004) for k in ks) for ks in ((0, 1), (2, 3)))
        found = assess(ship, Record(batches=used), EstimateOptions(methods=("oe",), mean="none"))
        least = estimate(
            Record(batches=used), ship.model, method="ls", settings=Settings(integration=RK4, quadrature="trapezoid")
        )
        ahead = Ahead(ship.model, apart, wind=False, integration=RK4)
        own, other = (
            np.log(ahead.shares([model] * 2)).mean()
            for model in (found.best.model, ship.model.with_parameters(least.assignments))
        )
        gains.append(own - other)
    assert np.mean(gains) < 3 * np.std(gains) / np.sqrt(len(gains)) + 0.01
    assert np.mean(gains) < 0.01


@pytest.mark.thorough
def test_output_error_that_predicts_worse_gives_way_to_its_start_and_says_so() -> None:
    """Forces without memory and exact sensors: least squares is efficient, and simulations of whole runs are not."""
    fallen = []
    for seed in range(8):
        batches = tuple(yaw_run(1000 + 10 * seed + k, samples=44, white=0.006, noise=0.0) for k in range(4))
        found = assess(yaw_ship(), Record(batches=batches), EstimateOptions(methods=("oe",), mean="none"))
        least = min(item.share for item in found.compared)
        (own,) = (item for item in found.compared if item.label == found.best.label)
        assert own.share <= 1.02 * least
        if found.best.method.name == "ls":
            fallen.append(found.why)
            assert [item.method.name for item in found.methods] == ["oe", "ls"]
    assert fallen
    assert all("output error starts from it" in why for why in fallen)


@pytest.mark.thorough
def test_a_method_without_an_answer_costs_itself_only_and_says_what_helps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The thrust is constant: with its mean taken off the instruments of X_mu are zero."""
    commands = model_ship_commands(1500)
    values = commands.values.copy()
    values[:, 0] = 7000.0
    path = write_run(tmp_path / "one.csv", quiet(MODEL_SHIP_TRUE), replace(commands, values=values), **EULER)
    asked = ["estimate", str(path), "--vessel", str(MODEL_SHIP), "--method", "ls", "iv"]
    assert main([*asked, "--out", str(tmp_path / "a")]) == 0
    told = capsys.readouterr().out
    assert list(json.loads((tmp_path / "a" / "estimate.json").read_text(encoding="utf-8"))) == ["ls"]
    assert "--mean none" in told
    assert main([*asked, "--out", str(tmp_path / "b"), "--mean", "none"]) == 0
    assert list(json.loads((tmp_path / "b" / "estimate.json").read_text(encoding="utf-8"))) == ["ls", "iv"]


@pytest.mark.outside
def test_output_error_of_a_tank_predicts_better_than_least_squares() -> None:
    """A search over short horizons used to diverge there, and a current was blamed."""
    folder = outside("field/oe-worse")
    ship = load_vessel(folder / "marin10.toml")
    record = load_records(sorted(folder.glob("*.csv")), vessel_inputs=ship.model.inputs)
    found = assess(ship, record, EstimateOptions(methods=("oe",), mean="none"))
    shares = {item.label: item.share for item in found.compared}
    assert found.best.label == "oe over 30 s"
    assert shares["oe over 30 s"] < 0.8 * shares["ls"]
    assert not any("current" in str(error) for _, error in found.failures)
