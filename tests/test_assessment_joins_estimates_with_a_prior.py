"""Estimates joined with what was known before: the information of both adds up, and a contradiction is told."""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from expdesign import workflows
from expdesign.assessment import EstimateOptions, assess
from expdesign.assessment.prior import apart_from_stated, held_for, released, with_prior
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.values import into_range
from expdesign.export.estimate_page import out_of_range
from expdesign.export.files import vessel_toml
from expdesign.records import load_records
from expdesign.reduction import reduced
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands, Record
from expdesign.vessel import Term, VesselModel
from measured_trials import held, write_run
from synthetic_ship import sail, trial, vessel_file, write

TWIN_SCREW = Path(__file__).parents[1] / "expdesign" / "templates" / "twin-screw" / "vessel.toml"
NAMES = ("X_u", "X_abs_u_u")
TERMS = (Term("u", "X_u", "u"), Term("u", "X_abs_u_u", "abs(u)*u"))


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """What of an estimate is joined: two parameters and one nuisance number."""

    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    nuisance_values: np.ndarray
    joint_covariance: np.ndarray
    warnings: tuple[str, ...] = ()
    between_runs: np.ndarray | float = 0.0

    @property
    def std(self) -> np.ndarray:
        return np.sqrt(np.diag(self.covariance))


def found(seed: int) -> Found:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    joint = root @ root.T + 0.1 * np.eye(3)
    values = rng.normal(size=3)
    return Found(
        names=NAMES, values=values[:2], covariance=joint[:2, :2], nuisance_values=values[2:], joint_covariance=joint
    )


def known(std: list[float]) -> VesselModel:
    return VesselModel(
        terms=TERMS,
        parameters=np.array([0.3, -0.2]),
        parameter_std=np.array(std),
        form="discrete",
        sample_time_s=1.0,
        actuators=(),
    )


@pytest.mark.parametrize("seed", range(3))
def test_information_of_prior_and_data_adds_up(seed: int) -> None:
    before, model = found(seed), known([0.5, 2.0])
    after = with_prior(before, model)
    prior = np.diag([0.5**-2, 2.0**-2, 0.0])
    information = np.linalg.inv(before.joint_covariance)
    expected = np.linalg.inv(information + prior)
    numbers = np.concatenate([before.values, before.nuisance_values])
    mean = expected @ (information @ numbers + prior @ [0.3, -0.2, 0.0])
    np.testing.assert_allclose(after.joint_covariance, expected, rtol=1e-9)
    np.testing.assert_allclose(np.concatenate([after.values, after.nuisance_values]), mean, rtol=1e-9)
    np.testing.assert_allclose(after.covariance, expected[:2, :2], rtol=1e-9)


@pytest.mark.parametrize("size", [1e4, 1e8, 1e12])
def test_data_that_hardly_show_a_combination_leave_it_to_the_prior(size: float) -> None:
    """Of a boat's shafts and drag they show a sum alone."""
    before, along = found(5), np.array([0.8, -0.6, 0.3])
    joint = before.joint_covariance + size * np.outer(along, along)
    model = replace(known([0.5, 2.0]), parameter_range={"X_u": (1.0, np.inf)})
    after = with_prior(replace(before, joint_covariance=joint, covariance=joint[:2, :2]), model)
    assert np.linalg.eigvalsh(after.joint_covariance).min() > 0
    seen = np.linalg.svd(along[None])[2][1:]  # directions of which the data tell
    information = seen.T @ np.linalg.inv(seen @ before.joint_covariance @ seen.T) @ seen
    expected = np.linalg.inv(information + np.diag([0.5**-2, 2.0**-2, 0.0]))
    np.testing.assert_allclose(after.joint_covariance, expected, rtol=10 / size + 1e-3)
    assert after.values[0] == pytest.approx(1.0)


def test_a_parameter_without_standard_deviation_keeps_its_value() -> None:
    after = with_prior(found(0), known([0.0, 1.0]))
    assert after.values[0] == pytest.approx(0.3, abs=1e-12)
    assert after.covariance[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_an_estimate_without_a_prior_needs_ten_samples_more_than_an_equation_has_parameters() -> None:
    """Fewer do not show their own errors; a prior states them."""
    vessel, rng = load_vessel(TWIN_SCREW), np.random.default_rng(0)
    counts = [sum(term.equation == equation for term in vessel.model.terms) for equation in "uvr"]
    need, steps = max(counts) + 10, range(-2, 3)
    refused = []
    for prior, more in itertools.product(("none", "parameter_std"), steps):
        shape = (need + more, len(vessel.model.inputs))
        batch = Batch(
            name="run", sample_time_s=vessel.sample_time_s, input_names=vessel.model.inputs,
            inputs=rng.uniform(0.1, 1.0, shape), velocity=rng.normal([2.0, 0.0, 0.0], 0.05, (need + more, 3)),
        )  # fmt: skip
        try:
            assess(vessel, Record(batches=(batch,)), EstimateOptions(methods=("ls",), prior=prior))
        except NotInformative as error:
            if "or more: fewer do not show" in str(error):
                refused.append((prior, more))
    assert refused == [("none", -2), ("none", -1)]


def test_a_contradiction_is_told_and_agreement_is_not() -> None:
    near, model = found(1), known([0.1, 0.1])
    agreeing = replace(near, values=model.parameters.copy())
    assert not with_prior(agreeing, model).warnings
    far = replace(near, values=model.parameters + np.array([0.0, 100.0]))
    (warning,) = with_prior(far, model).warnings
    assert "contradict" in warning
    assert "X_abs_u_u" in warning


@pytest.mark.parametrize("parameter", [0, 1])
def test_what_is_joined_does_not_depend_on_units(parameter: int) -> None:
    """A parameter held at the end of its range takes the others with it by as much."""
    size = np.ones(3)
    size[parameter] = 1e9
    before, model = found(2), known([0.5, 2.0])
    held = float(with_prior(before, model).values[0]) + 0.4
    plain = with_prior(before, replace(model, parameter_range={"X_u": (held, np.inf)}))
    other = with_prior(
        replace(
            before, values=size[:2] * before.values, joint_covariance=np.outer(size, size) * before.joint_covariance,
            covariance=np.outer(size[:2], size[:2]) * before.covariance,
        ),
        replace(
            model, parameters=size[:2] * model.parameters, parameter_std=size[:2] * model.parameter_std,
            parameter_range={"X_u": (size[0] * held, np.inf)},
        ),
    )  # fmt: skip
    np.testing.assert_allclose(other.values / size[:2], plain.values, rtol=1e-6)
    np.testing.assert_allclose(other.nuisance_values, plain.nuisance_values, rtol=1e-6)


def test_values_outside_a_stated_range_move_to_its_end_and_the_others_with_them() -> None:
    """The most probable point of a normal density on a half-space: on its face, others by their correlation."""
    before, model = found(2), known([0.5, 2.0])
    free = with_prior(before, model)
    ranges = {"X_u": (free.values[0] + 0.4, np.inf), "X_abs_u_u": (-np.inf, 1e3)}
    after = with_prior(before, replace(model, parameter_range=ranges))
    slope = free.joint_covariance[:, 0] / free.joint_covariance[0, 0]
    expected = np.concatenate([free.values, free.nuisance_values]) + 0.4 * slope
    np.testing.assert_allclose(np.concatenate([after.values, after.nuisance_values]), expected, rtol=1e-9)
    np.testing.assert_array_equal(after.covariance, free.covariance)
    assert "range that the vessel file states: X_u." in after.warnings[-1]
    assert with_prior(before, replace(model, parameter_range={"X_u": (-1e3, 1e3)})).warnings == free.warnings


@pytest.mark.parametrize("seed", range(5))
def test_values_in_range_are_the_most_probable_of_many(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, 4))
    covariance, values = root @ root.T + 0.01 * np.eye(4), rng.normal(size=4)
    ends = [(0.5, np.inf), (-np.inf, -0.5), (-0.1, 0.1), (-np.inf, np.inf)]
    low, high = np.array(ends).T

    def apart(x: np.ndarray) -> np.ndarray:
        return np.einsum("ij,ij->i", x - values, np.linalg.solve(covariance, (x - values).T).T)

    best = into_range(values, covariance, ends)
    assert (low <= best).all()
    assert (best <= high).all()
    others = np.clip(best + 10.0 ** rng.uniform(-6, 1, (5000, 1)) * rng.normal(size=(5000, 4)), low, high)
    assert apart(best[None])[0] <= apart(others).min() * (1 + 1e-9)


def test_values_follow_each_other_though_rounding_left_a_negative_variance() -> None:
    """Where data hardly show a difference, the covariance that remains beside it is rounded by more than its least."""
    covariance = np.ones((2, 2)) - 1e-10 * np.outer([1.0, -1.0], [1.0, -1.0])
    assert np.linalg.eigvalsh(covariance)[0] < 0
    moved = into_range(np.array([0.3, 0.1]), covariance, [(0.5, np.inf), (-np.inf, np.inf)])
    assert moved == pytest.approx([0.5, 0.3], abs=1e-5)


def test_a_range_falls_away_where_the_estimate_alone_contradicts_it() -> None:
    """Without a prior the data alone speak; no ship could be drawn between such values and the range."""
    model = replace(known([0.1, 0.1]), parameter_range={"X_u": (0.0, np.inf), "X_abs_u_u": (-np.inf, 0.0)})
    near = model.with_parameters({"X_u": -0.2}).with_kept_ranges()
    far = model.with_parameters({"X_u": -0.4}).with_kept_ranges()
    assert near.parameter_range == model.parameter_range
    assert far.contradicted_ranges == ()
    assert far.parameter_range == {"X_abs_u_u": (-np.inf, 0.0)}
    assert (far.drawn_parameters(100, np.random.default_rng(0))[:, 1] <= 0.0).all()


@pytest.mark.parametrize(("low", "told"), [(0.2, ""), (0.35, ""), (0.7, "X_u")])
def test_an_estimate_of_which_hardly_any_ship_is_in_range_says_so(low: float, told: str) -> None:
    """Its vessel file cannot be planned with; that was said no sooner than by the plan."""
    model = replace(known([0.1, 0.1]), parameter_range={"X_u": (low, np.inf), "X_abs_u_u": (-np.inf, 0.0)})
    sentences = out_of_range(model)
    assert len(sentences) == bool(told)
    if told:
        assert f"by {told}. " in sentences[0]
        with pytest.raises(InputError, match=r"model\.parameter_min"):
            model.drawn_parameters(100, np.random.default_rng(0))


def test_euler_s_parameters_have_no_such_prior() -> None:
    with pytest.raises(InputError, match="continuous motion"):
        EstimateOptions(prior="parameter_std", motion="euler")


def test_what_runs_differ_by_widens_the_joined_estimate_and_leaves_its_values() -> None:
    """With D that share of the data's covariance the joined one is larger by A D A', where A carries data to it."""
    before, model = found(3), known([0.5, 2.0])
    differ = np.outer([0.4, -0.3, 0.2], [0.4, -0.3, 0.2])
    wide = replace(
        before, between_runs=differ, joint_covariance=before.joint_covariance + differ,
        covariance=before.covariance + differ[:2, :2],
    )  # fmt: skip
    own, wider = with_prior(before, model), with_prior(wide, model)
    np.testing.assert_allclose(wider.values, own.values, rtol=1e-9)
    moved = [
        with_prior(
            replace(before, values=before.values + step[:2], nuisance_values=before.nuisance_values + step[2:]), model
        )
        for step in np.eye(3)
    ]
    A = np.array(
        [np.concatenate([one.values - own.values, one.nuisance_values - own.nuisance_values]) for one in moved]
    ).T
    np.testing.assert_allclose(wider.joint_covariance - own.joint_covariance, A @ differ @ A.T, atol=1e-9)


@dataclass(frozen=True, kw_only=True, eq=False)
class Part(Found):
    """An estimate with some parameters held."""

    held: dict[str, float]
    nuisance_names: tuple[str, ...] = ("current",)

    @property
    def assignments(self) -> dict[str, float]:
        return dict(zip(self.names, self.values.tolist(), strict=True)) | self.held


@pytest.mark.parametrize("unseen", [(1.0, 0.0, 0.0), (3.0, -2.0, 0.0), (3.0, -2.0, 0.5)])
def test_what_data_do_not_show_is_the_prior_s_and_the_rest_is_joined(unseen: tuple[float, float, float]) -> None:
    """The posterior has the information of prior and data, of which the latter shows nothing along `unseen`."""
    rng, along, prior = np.random.default_rng(4), np.array(unseen), np.diag([0.5**-2, 2.0**-2, 0.0])
    seen = np.linalg.qr(np.column_stack([along, rng.normal(size=(3, 2))]))[0][:, 1:]
    root = seen @ rng.normal(size=(2, 2))
    information, truth = root @ root.T, np.array([0.5, 0.4, 0.1])
    model = known([0.5, 2.0])
    error = NotInformative("unseen", unseen=({"X_u": unseen[0], "X_abs_u_u": unseen[1], "current": unseen[2]},))
    (fixed,) = held_for(error, model)
    place = NAMES.index(fixed)
    kept = [other for other in range(3) if other != place]
    # data whose most likely numbers are the truth, or any along the combination: that with the held one at its prior
    numbers = truth + along * (model.parameters[place] - truth[place]) / along[place]
    covariance = np.linalg.inv(information[np.ix_(kept, kept)])
    part = Part(
        names=tuple(name for name in NAMES if name != fixed), values=numbers[kept[:1]], covariance=covariance[:1, :1],
        nuisance_values=numbers[2:], joint_covariance=covariance, held={fixed: model.parameters[place]},
    )  # fmt: skip
    after = with_prior(released(part, error, model), model)
    expected = np.linalg.inv(information + prior)
    mean = expected @ (information @ truth + prior @ [0.3, -0.2, 0.0])
    np.testing.assert_allclose(np.concatenate([after.values, after.nuisance_values]), mean, atol=2e-3)
    np.testing.assert_allclose(after.joint_covariance, expected, atol=1e-3 * np.abs(expected).max())
    assert fixed in after.warnings[0]


@pytest.mark.thorough
def test_twin_screws_that_are_ordered_together_are_estimated_with_a_prior(tmp_path: Path) -> None:
    """What tells port from starboard stays as the card had it; without a prior the data are refused."""
    truth = load_vessel(TWIN_SCREW)
    rng = np.random.default_rng(0)
    shafts, helms = 3.0 + 0.8 * held(rng, 800), 0.5 * held(rng, 800)
    columns = {"n1": shafts, "n2": shafts, "rudder1": helms, "rudder2": helms}
    values = np.stack([columns.get(name, 0.0 * shafts) for name in truth.model.inputs], axis=1)
    commands = Commands(sample_time_s=truth.sample_time_s, names=truth.model.inputs, values=values)
    path = write_run(tmp_path / "run.csv", truth, commands, velocity=(4.0, 0.0, 0.0))
    model = truth.model
    guess = replace(
        truth,
        model=replace(
            model,
            parameters=1.1 * model.parameters,
            parameter_std=0.2 * np.abs(model.parameters),
            parameter_correlation={},
        ),
    )
    (tmp_path / "guess.toml").write_text(vessel_toml(guess))
    ask = {"vessel": tmp_path / "guess.toml", "methods": ("ls",)}
    with pytest.raises(NotInformative, match="X_T2"):
        workflows.estimate([path], tmp_path / "none", **ask)
    workflows.estimate([path], tmp_path / "joined", prior="parameter_std", **ask)
    after = load_vessel(tmp_path / "joined" / "vessel-estimated.toml").model
    apart = (after.parameters - model.parameters) / after.parameter_std
    assert np.abs(apart).max() < 4.0
    std, place = after.parameter_std / np.abs(model.parameters), model.names.index
    assert std[place("X_T1")] > 0.1
    joint = after.parameter_covariance[np.ix_(*[[place("X_T1"), place("X_T2")]] * 2)].sum() ** 0.5
    assert joint < 0.05 * 2 * model.parameters[place("X_T1")]
    assert "X_T2" in (tmp_path / "joined" / "estimate.json").read_text()


INPUTS_AS_RECORDED = {
    "as they are": ({}, ""),
    "half": ({"n1_rps": 0.5}, "X_nn"),
    "a tenth": ({"n1_rps": 0.1}, "X_nn"),
    "a share of full speed": ({"n1_rps": 0.25}, "X_nn"),
    "helm at half": ({"reached": 0.5}, "N_ud"),
    "helm at a third, engine a fifth too high": ({"reached": 0.3, "n1_rps": 1.2}, "N_ud"),
}


@pytest.mark.parametrize("case", INPUTS_AS_RECORDED)
def test_an_input_in_another_unit_makes_an_estimate_that_is_told_to_be_far_from_what_is_stated(
    tmp_path: Path, case: str
) -> None:
    """The parameters take the factor up and the fit is as good; nothing but the vessel file can show it."""
    factors, told = INPUTS_AS_RECORDED[case]
    columns = sail(trial())
    recorded = columns | {name: columns[name] * factor for name, factor in factors.items()}
    ship = load_vessel(vessel_file(tmp_path / "ship.toml"))
    ship = replace(ship, model=replace(ship.model, parameter_std=0.1 * np.abs(ship.model.parameters)))
    data = write(tmp_path / "trial.csv", recorded, seed=1, reached="reached_rudder1_rad", rudder1_rad="")
    record = reduced(load_records(data, vessel_inputs=ship.model.inputs), ship)
    found = assess(ship, record, EstimateOptions(methods=("iv",), mean="none"))
    said = [text for text in found.best.estimate.warnings if "times what the vessel file states" in text]
    assert [text.split()[0] for text in said] == [told] * bool(told)
    joined = assess(ship, record, EstimateOptions(methods=("iv",), mean="none", prior="parameter_std"))
    assert not any("times what the vessel file states" in text for text in joined.best.estimate.warnings)


@pytest.mark.thorough
def test_estimates_of_a_ship_as_stated_are_not_told_to_be_far() -> None:
    """True values drawn as stated and estimates as their covariance says: at most one in 10^4 of each is told."""
    rng, model, told, draws = np.random.default_rng(3), known([0.1, 0.05]), 0, 4000
    covariance = np.array([[0.04, 0.01], [0.01, 0.02]])
    for _ in range(draws):
        truth = model.parameters + rng.normal(size=2) * model.parameter_std
        values = rng.multivariate_normal(truth, covariance)
        one = replace(found(0), values=values, covariance=covariance)
        told += bool(apart_from_stated(one, model))
    assert told <= 4  # 2 x 6.3e-5 x 4000 = 0.5 expected; more than 4 has a chance below 2e-4
