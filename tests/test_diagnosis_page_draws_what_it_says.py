"""What is drawn of a simulation's error: what the model lacks, and findings against what they depend on."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import Estimate, Finding, diagnose
from expdesign.diagnosis.accuracy import Residuals, _slopes, dependence, mean_residual, one_step_residuals
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.vessel_file.reading import extended_model, public_name
from expdesign.export import diagnosis_figures as diagnosis_figures
from expdesign.export.diagnosis_figures import has_sign, is_force, suspected, suspected_force
from expdesign.export.diagnosis_page import diagnosis_document
from expdesign.export.diagnosis_results import diagnosis_json, extended_vessel
from expdesign.export.pages import document_html

ALONE = ("u", "v", "r", "n1", "a1", "n2", "a2", "u_q", "v_q", "heading", "time", "run")


@pytest.fixture(scope="module")
def clean():
    return diagnose(vessel_of("tug"), hidden_record("tug", seed=3, batches=3, samples=120))


@pytest.fixture
def only_words(monkeypatch):
    monkeypatch.setattr(diagnosis_figures, "svg", lambda *_, **__: "")


def finding(keys: tuple[str, ...], cause: str = "parameters", estimates: tuple[Estimate, ...] = ()) -> Finding:
    return Finding(
        cause=cause, estimates=estimates, p_value=1e-6, fit_before=np.zeros(3), fit_after=np.ones(3),
        error_reductions=(), gain=1.0, gain_interval=(0.5, 1.5), not_distinguishable_from=(),
        would_tell_apart=None, explanation="made up", likelihood_gain=30.0, keys=keys,
    )  # fmt: skip


def test_a_model_that_was_not_extended_is_not_called_so(clean):
    """On the page and in the vessel file; a diagnosis with something to write says the opposite."""
    extended = replace(clean, after=replace(clean.before))
    for found, begin, there in ((clean, "# Kept as it was by a diagnosis", True), (extended, "# Extended", False)):
        assert extended_vessel(found, command="").startswith(begin)
        page = document_html(diagnosis_document(found))
        assert ("Nothing was found to extend the model by" in page) is there
        assert ("extended model" in page.partition("<h2>Method")[0]) is not there  # no second, equal column or line


def test_errors_grow_over_the_times_that_the_axis_says(clean):
    """Windows of slow samples are no shorter than twelve of these: no error is drawn at a shorter time than theirs."""
    model, record = extended_model(clean.vessel, clean.record).model, clean.record
    assert len(clean.before.horizons_s) > 2
    for horizon_s in clean.before.horizons_s.tolist():
        windows = cut_windows(model, record, longest_s=horizon_s)
        assert windows.steps * windows.step_s == pytest.approx(horizon_s, rel=0.25)
    rows = clean.before.growth
    assert len(np.unique(rows, axis=0)) == len(rows)


@pytest.mark.parametrize("growing", [0.0, 0.01, 1.0, 1e6])
def test_a_line_of_errors_leaves_the_figure_only_where_the_simulation_diverges(monkeypatch, clean, growing):
    """A level line has no range of values, and is drawn whole, too."""
    steps = np.linspace(0.0, growing, len(clean.before.horizons_s))
    rows = 0.1 * (1.0 + steps)[:, None] * np.nanstd(clean.windows.measured[..., :3], axis=(0, 1))
    drawn: list[tuple[float, float]] = []

    def limits(figure, **_: object) -> str:
        drawn.extend((axes.get_ylim()[1], float(axes.dataLim.intervaly[1])) for axes in figure.axes)
        return ""

    monkeypatch.setattr(diagnosis_figures, "svg", limits)
    before = replace(clean.before, growth=rows)
    diagnosis_figures.growth_figure(replace(clean, before=before, after=before))
    assert len(drawn) == 3
    assert all(bool(top > 1.1 * largest) is (growing < 1e6) for top, largest in drawn)


def test_slopes_of_straight_errors_are_exact_whatever_is_missing():
    error = 3.0 + 0.5 * 0.2 * np.arange(10)[None, :, None] * np.ones((2, 10, 3))
    error[0, [0, 4, 9], 1] = np.nan
    slopes, count = _slopes(error, 0.2)
    np.testing.assert_allclose(slopes, 0.5)
    assert count.tolist() == [[10, 7, 10], [10, 10, 10]]


@pytest.mark.parametrize(
    ("alike", "by", "most"), [(0.0, "u", 0.05), (0.0, "time", 0.05), (0.5, "u", 0.05), (0.5, "time", 0.1)]
)
def test_chance_alone_colours_no_more_than_it_should(alike, by, most):
    """Of 400 series that depend on nothing, white or alike by a half; these look like drifts twice as often at most."""
    rng = np.random.default_rng(0)
    p_values = []
    for _ in range(400):
        acceleration, run = rng.standard_normal((160, 1)), np.repeat(np.arange(4.0), 40)
        for k in range(1, 160):
            acceleration[k] += alike * acceleration[k - 1]
        variables = {"u": rng.standard_normal(160), "time": np.arange(160.0), "run": run}
        found = Residuals(outputs=("u",), stretch_s=10.0, acceleration=acceleration, variables=variables)
        p_values.append(dependence(found, "u", by).p_value)
    assert np.mean(np.array(p_values) < 0.05) < most + 4 * np.sqrt(0.05 * 0.95 / 400)


def test_the_mean_on_the_whole_is_as_uncertain_as_it_varies():
    """Of 300 white series of 100 stretches, the squared ratio to the standard error is chi-squared, 300 in all."""
    rng, ratios = np.random.default_rng(3), []
    for _ in range(300):
        found = Residuals(
            outputs=("u",), stretch_s=10.0, acceleration=2.0 + rng.standard_normal((100, 1)),
            variables={"run": np.repeat(np.arange(4.0), 25)},
        )  # fmt: skip
        mean, std = mean_residual(found, "u")
        ratios.append((mean - 2.0) / std)
    assert abs(np.sum(np.square(ratios)) - 300) < 4 * np.sqrt(600)


def test_a_current_shows_by_heading_before_any_cause_is_named():
    record = hidden_record("tug", seed=3, batches=6, samples=200, current=(0.2, 0.1))
    ship = extended_model(vessel_of("tug"), record)
    residuals = one_step_residuals(ship, cut_windows(ship.model, record))
    assert tuple(residuals.variables) == ALONE
    for output in ("u", "v"):
        by = {name: dependence(residuals, output, name).p_value for name in residuals.variables}
        assert min(by, key=by.__getitem__) == "heading"
        assert by["heading"] < 1e-6


def test_a_stretch_shows_the_acceleration_that_is_missing():
    """Yaw acceleration g tau_x too much: after t the rate is off by g tau_x (1 - exp(-d t)) / d, with the damping d.

    Less what the initial state takes off the first five samples. What sway does to yaw beside it, and orders that
    change in a stretch, leave the comparison good to a seventh.
    """
    record = hidden_record("barge", seed=3, batches=4, samples=200)
    ship = extended_model(vessel_of("barge"), record)
    windows = cut_windows(ship.model, record)
    right, wrong = (one_step_residuals(one, windows) for one in (ship, ship.with_effects({"asymmetry": 0.6})))
    slope = np.polyfit(right.variables["tau_x"], wrong.acceleration[:, 2] - right.acceleration[:, 2], 1)[0]
    time = np.arange(10.0)
    fading, pushed = np.exp(-0.12 * time), (1 - np.exp(-0.12 * time)) / 0.12
    start = fading[:5] @ pushed[:5] / (fading[:5] @ fading[:5])
    expected = -0.6 * 0.0004 * np.polyfit(time, pushed - start * fading, 1)[0]
    assert slope == pytest.approx(expected, rel=1 / 7)


BY_FORCE = {
    "term:Y_abs_r_r": "Y_abs_r_r", "theta:X_u": "X_u: u", "deadband:a": "a1 [rad]", "offset:n2": "n2 [rps]",
    "gain": "ahead force, tau_x", "asymmetry": "ahead force", "shallow:damping": "water depth",
}  # fmt: skip
BY_ERROR = {
    "lag:n": "time since", "delay:all": "time since", "inertia:v": "rate of change of v", "late:psi": "r [",
    "late:r": "rate of change of r", "gyro": "r [", "gyro_bias": "r [", "lever:forward": "r [", "heading_bias": "u [",
    "current:north": "heading", "roll:sway": "time [min]", "change:time": "time [min]",
}  # fmt: skip


@pytest.mark.parametrize("key", [*BY_FORCE, *BY_ERROR])
def test_a_finding_is_drawn_against_what_it_depends_on(key, clean):
    name = public_name(key, extended_model(clean.vessel, clean.record))[0]
    item = finding((key,), estimates=(Estimate(name=name, value=1.0, std=0.1, unit=""),))
    item = replace(item, cause="parameters" if key.startswith("theta") else "any")
    assert is_force(clean, item) == (key in BY_FORCE)
    if key in BY_FORCE:
        at = {**clean.residuals.variables, "depth": np.full(len(clean.residuals.acceleration), 8.0)}
        values, label = suspected_force(clean, item, at)
        assert values.shape == clean.residuals.acceleration[:, 0].shape
    else:
        values, label = suspected(clean, item)
        assert values.shape == clean.windows.measured.shape[:2]
    assert (BY_FORCE | BY_ERROR)[key] in label


def test_regressors_and_times_since_changes_are_those_of_the_data(clean):
    at = clean.residuals.variables
    values, _ = suspected_force(clean, finding(("term:Y_abs_r_r",), "missing_term:Y_abs_r_r"), at)
    np.testing.assert_allclose(values, np.abs(at["r"]) * at["r"])
    force, _ = suspected_force(clean, finding(("gain",), "thrust_gain"), at)
    np.testing.assert_allclose(force, at["n1"] * np.cos(at["a1"]) + at["n2"] * np.cos(at["a2"]))
    late, _ = suspected(clean, finding(("lag:n",), "actuator_lag"))
    orders = clean.windows.step_inputs[..., [0, 2]]
    changed = np.zeros(late.shape, dtype=bool)
    changed[:, 1:] = np.abs(np.diff(orders, axis=1)).sum(axis=2) > 1.0
    assert changed.any()
    assert (late[changed] == 0).all()
    assert set(late[:, 1:][changed[:, :-1]].tolist()) <= {0.0, clean.windows.sample_s}
    assert not has_sign(finding(("lag:n",)))


@pytest.mark.parametrize("key", ["gain", "asymmetry"])
def test_the_force_ahead_of_a_ship_with_a_rudder_is_that_of_her_propellers(key):
    vessel, n1 = vessel_of("coaster"), np.linspace(-2.0, 3.0, 11)
    found = SimpleNamespace(
        vessel=vessel, extended=vessel, record=hidden_record("coaster", seed=3, batches=1, samples=20)
    )
    at = {name: np.full(11, 0.1) for name in ("u", "v", "r", "rudder1", "time")} | {"n1": n1}
    values, label = suspected_force(found, finding((key,), "thrust_gain"), at)
    np.testing.assert_allclose(values, np.abs(n1) * n1)
    assert label.startswith("ahead force")


def test_of_several_parameters_the_clearest_is_drawn(clean):
    model = clean.vessel.model
    names = ("X_u", "Y_v")
    estimates = tuple(
        Estimate(name=name, value=float(model.parameters[model.names.index(name)]) + moved, std=0.01, unit="")
        for name, moved in zip(names, (0.01, -0.2), strict=True)
    )
    item = finding(("theta:X_u", "theta:Y_v"), estimates=estimates)
    assert suspected_force(clean, item, clean.residuals.variables)[1] == "Y_v: v"


@pytest.mark.thorough
def test_two_findings_of_one_cause_have_a_picture_each(clean):
    items = tuple(
        finding((f"theta:{name}",), estimates=(Estimate(name=name, value=0.1, std=0.01, unit=""),))
        for name in ("X_u", "Y_v")
    )
    found = replace(clean, findings=items, errors=(clean.windows.measured,) * 2, step_residuals=(clean.residuals,) * 2)
    page = document_html(diagnosis_document(found))
    assert "X_u: u" in page
    assert "Y_v: v" in page
    assert page.index("Missing acceleration") < page.index("<h2>1. ")


@pytest.mark.parametrize(("p_value", "said"), [(0.024, False), (0.049, False), (0.25, True)])
@pytest.mark.usefixtures("only_words")
def test_a_cause_with_a_large_p_value_is_said_to_stay_for_another_reason(clean, p_value: float, said: bool):
    item = finding(("theta:X_u",), estimates=(Estimate(name="X_u", value=0.1, std=0.01, unit=""),))
    found = replace(
        clean, findings=(replace(item, p_value=p_value),), errors=(clean.windows.measured,),
        step_residuals=(clean.residuals,),
    )  # fmt: skip
    page = document_html(diagnosis_document(found))
    assert f">{p_value:.2g}" in page
    assert ("it stays because simulations of held-out data are worse without it" in page) is said


@pytest.mark.usefixtures("only_words")
def test_data_too_short_for_the_residuals_are_noted(clean):
    short = replace(
        clean.residuals,
        acceleration=clean.residuals.acceleration[:5],
        variables={name: values[:5] for name, values in clean.residuals.variables.items()},
    )
    found = replace(clean, residuals=short)
    assert "too short for that" in document_html(diagnosis_document(found))
    assert json.loads(diagnosis_json(found))["residuals"]["p_values"]["u"]["heading"] is None


@pytest.mark.parametrize(("names", "words"), [(("run",), "This variable"), (("run", "heading"), "These 2 variables")])
@pytest.mark.usefixtures("only_words")
def test_one_variable_is_not_called_several(clean, names, words):
    some = replace(clean.residuals, variables={name: clean.residuals.variables[name] for name in names})
    assert f"{words}</summary>" in document_html(diagnosis_document(replace(clean, residuals=some)))
