"""Whatever a diagnosis finds, the vessel file it writes is read again and used like any other."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import CAUSES, Estimate, Finding
from expdesign.diagnosis import diagnose as diagnose_record
from expdesign.diagnosis.accuracy import accuracy
from expdesign.diagnosis.motion.equations_of_motion import state_rates
from expdesign.diagnosis.motion.inputs import ExogenousInputs
from expdesign.diagnosis.motion.simulation import initial_states, simulate_windows
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend, in_shallow_water
from expdesign.dictionary import PrimitiveSpec, build_dictionary
from expdesign.dictionary.build import family
from expdesign.dictionary.spec import complete_settings
from expdesign.estimation.instrumental import Settings
from expdesign.estimation.methods import estimate
from expdesign.estimation.regression.regression import model_for, with_depth
from expdesign.estimation.replay.replay import Integration, simulate_batch
from expdesign.export.diagnosis_page import diagnosis_document
from expdesign.export.diagnosis_results import extended_vessel
from expdesign.export.files import vessel_toml
from expdesign.export.pages import document_html
from expdesign.information import score_primitives
from expdesign.scenario import load_vessel
from expdesign.signals import Record
from expdesign.vessel import NUMPY, Limit
from expdesign.vessel.quantities import GAINS_AND_OFFSETS

EFFECTS = {
    "parameters": {"theta:Y_v": -0.01},
    "current": {"current:north": 0.2, "current:east": -0.1},
    "wind": {"wind:north": 4.0, "wind:east": 2.0},
    "missing_term": {"term:Y_abs_r_r": -0.3},
    "thrust_gain": {"gain": -0.1},
    "thrust_advance_loss": {"theta:X_kappa": -0.001},
    "thruster_asymmetry": {"offset:a": 0.05},
    "actuator_lag": {"lag:all": 3.0},
    "actuator_delay": {"delay:n": 2.0},
    "actuator_slew": {"slew:a": 10.0},
    "actuator_deadband": {"deadband:n": 6.0},
    "load_change": {"inertia:u": 0.2, "inertia:v": 0.1},
    "heading_bias": {"heading_bias": 0.03},
    "lever_arm": {"lever:forward": 4.0},
    "sensor_delay": {"late:r": 1.0},
    **{row.fault.name: {row.effects[0]: row.matters} for row in GAINS_AND_OFFSETS if row.fault},
    "shallow_water": {"shallow:damping": 0.8, "shallow:inertia": 0.4},
    "roll_coupling": {"roll:sway": 0.1, "roll:yaw": 0.01, "roll:period": 8.0, "roll:damping": 0.08},
    "change_point": {"change:time": 300.0, "change:gain": -0.2},
}
GROWTH = {"damping": 0.8, "inertia": 0.4}
FREE = vessel_of("tug")
BOUNDED = tuple(replace(one, limits=(Limit(low=-20.0, high=20.0), Limit())) for one in FREE.actuators)
TUG = replace(FREE, model=replace(FREE.model, actuators=BOUNDED))
SPEC = PrimitiveSpec(
    name="run",
    family="acceleration",
    settings=complete_settings(family("acceleration"), {"duration_s": 60.0, "speed_mps": 1.5, "from_speed_mps": 0.5}),
)


def shoaling(seed: int = 3) -> Record:
    """Clean data of the tug with a depth between 4 and 15 m beside them."""
    record = hidden_record("tug", seed=seed, batches=4, samples=200)
    depth = 9.0 + 5.0 * np.sin(np.arange(200) / 15.0)
    return Record(batches=tuple(replace(batch, depth_m=depth) for batch in record.batches))


@pytest.fixture(scope="module")
def clean():
    return diagnose_record(TUG, shoaling())


def finding(cause: str) -> Finding:
    """A made-up finding; only its name and numbers are used."""
    numbers = GROWTH if cause == "shallow_water" else {}
    estimates = tuple(Estimate(name=name, value=value, std=0.1, unit="") for name, value in numbers.items())
    return Finding(
        cause=cause, estimates=estimates, p_value=1e-6, fit_before=np.zeros(3), fit_after=np.ones(3),
        error_reductions=(), gain=1.0, gain_interval=(0.5, 1.5), not_distinguishable_from=(),
        would_tell_apart=None, explanation="made up", likelihood_gain=30.0, keys=tuple(EFFECTS[cause]),
    )  # fmt: skip


def as_found(clean, cause: str):
    """A diagnosis that found one cause, put together as `diagnose` does it."""
    final = extended_model(TUG, clean.record).with_effects(EFFECTS[cause])
    extended, missing = extend(TUG, final, {})
    return replace(clean, extended=extended, findings=(finding(cause),), notes=missing), final


def test_every_cause_of_the_catalogue_is_tried():
    """But that of a rudder, which the tug lacks (`test_diagnosis_simulations_and_vessel_files_are_exact`), and orders
    that are late, which no file holds (`test_diagnosis_orders_recorded_late_are_named`).
    """
    assert {*EFFECTS, "actuator_scale", "late_orders"} == {cause.name for cause in CAUSES}


@pytest.mark.parametrize("cause", EFFECTS)
def test_the_file_with_a_cause_is_read_simulates_it_and_is_scored(cause, clean, tmp_path):
    found, final = as_found(clean, cause)
    path = tmp_path / "vessel-extended.toml"
    path.write_text(extended_vessel(found, command="made up"), encoding="utf-8")
    ship = load_vessel(path)
    assert ship.model.terms == found.extended.model.terms
    scored = score_primitives(ship, build_dictionary(ship, [SPEC]))
    assert np.isfinite(scored[0].X).all()
    assert vessel_toml(ship) != vessel_toml(TUG)
    assert not [note for note in found.notes if "not in the vessel file" in note]
    if "change:time" in final.effects:
        final = final.with_effects({"change:time": -1.0})  # the file describes the ship after it
    start = initial_states(clean.windows, final.states)
    predicted, wanted = (
        simulate_windows(one, clean.windows, start).predicted for one in (extended_model(ship, clean.record), final)
    )
    before = simulate_windows(extended_model(TUG, clean.record), clean.windows, start[:, :3]).predicted
    rough = 1e-3 if cause == "shallow_water" else 1e-9  # its factors are polynomials
    assert np.abs(predicted - wanted).max() <= rough * max(np.abs(wanted - before).max(), 1.0)
    assert np.abs(wanted - before).max() > 1e-3 or cause == "wind"  # which is measured in these data


def test_the_written_dependence_on_depth_is_the_one_found(clean):
    """Accelerations of the file's terms beside those of the diagnosis' own motion, at any depth in the data."""
    found, final = as_found(clean, "shallow_water")
    rng = np.random.default_rng(1)
    velocity, inputs = rng.uniform(-1, 1, (3, 40)), rng.uniform(-1, 1, (4, 40))
    shoal = rng.uniform(0.0, TUG.draught_m / 4.0, 40)
    own = final.model.signals(velocity, velocity[:2], inputs, NUMPY)
    exogenous = ExogenousInputs({n: np.broadcast_to(x, 40) for n, x in own.items() if n not in ("u", "v", "r", "h")})
    exogenous["h"] = shoal
    wanted = state_rates(final, tuple(velocity), exogenous)
    record = with_depth(clean.record, found.extended.draught_m)
    driven = model_for(found.extended.model, record)
    given = driven.accelerations(velocity, velocity[:2], [*inputs, shoal])
    _, error = in_shallow_water(TUG.model, GROWTH, reach=TUG.draught_m / 4.0, known=TUG.model)
    np.testing.assert_allclose(given, wanted, rtol=2 * error, atol=error * np.abs(wanted).max())


def test_deep_water_is_draught_over_depth_zero():
    model, error = in_shallow_water(TUG.model, GROWTH, reach=0.6, known=TUG.model)
    state = ((1.0, 0.2, 0.05), (2.0, -1.0), (5.0, 0.3, 4.0, -0.2))
    np.testing.assert_array_equal(model.accelerations(*state), TUG.model.accelerations(*state))
    assert model.reads_depth
    assert error < 2e-3


@pytest.mark.thorough
def test_estimates_read_the_measured_depth():
    """Noise-free motion of a model that reads depth, simulated over its depths, gives its parameters back."""
    model, _ = in_shallow_water(TUG.model, GROWTH, reach=0.6, known=TUG.model)
    record = with_depth(shoaling(), TUG.draught_m)
    how = Integration("rk4", 4)
    batches = tuple(
        replace(batch, velocity=simulate_batch(model, batch, integration=how).velocity) for batch in record.batches
    )
    held = tuple(name for name in model.names if name.startswith("W_"))
    settings = Settings(fixed=held, quadrature="trapezoid", integration=Integration("rk4", 2))
    found = estimate(Record(batches=batches), model, method="oe", settings=settings)
    truth = [model.parameters[model.names.index(name)] for name in found.names]
    blind = estimate(Record(batches=batches), TUG.model, method="oe", settings=settings)
    np.testing.assert_allclose(found.values, truth, rtol=1e-3, atol=1e-6)
    assert np.abs(blind.values / truth - 1).max() > 0.05


def test_a_dependence_on_depth_counts_as_known_however_the_depth_is_recorded():
    """Python or command line: draught over depth among the inputs, or only the depth beside them."""
    model, _ = in_shallow_water(TUG.model, GROWTH, reach=0.6, known=TUG.model)
    ship, record = replace(TUG, model=model), shoaling()
    plain, beside = (extended_model(ship, data) for data in (record, with_depth(record, TUG.draught_m)))
    assert plain.model.inputs == beside.model.inputs == TUG.model.inputs
    found = accuracy(plain, record), accuracy(beside, with_depth(record, TUG.draught_m))
    np.testing.assert_array_equal(found[0].rmse, found[1].rmse)
    assert np.abs(found[0].rmse / accuracy(extended_model(TUG, record), record).rmse - 1).max() > 0.05
    extended, _ = extend(ship, plain, {})
    assert extended.model.terms == model.terms


def test_growth_found_beyond_that_of_the_file_multiplies_it():
    model, _ = in_shallow_water(TUG.model, {"damping": 0.5}, reach=0.6, known=TUG.model)
    more, _ = in_shallow_water(model, {"damping": 0.4}, reach=0.6, known=model)
    before, after = (dict(zip(item.names, item.terms, strict=True))["Y_v"].expression for item in (model, more))
    assert (before, after) == ("(v)*(1 + 0.5*h)", "(v)*(1 + 0.9*h + 0.2*h*h)")
    state = (1.0, 0.2, 0.05), (2.0, -1.0), (5.0, 0.3, 4.0, -0.2)
    deep = [dict(zip(item.names, item.regressors(*state), strict=True))["Y_v"] for item in (TUG.model, more)]
    assert deep[0] == deep[1]


@pytest.mark.thorough
def test_the_page_of_a_lost_simulation_shows_no_astronomic_numbers(clean):
    """Models that are unstable on their course run away over whole runs; the size of that error says nothing."""
    lost = np.full(3, -1e8)
    before = replace(clean.before, fit=lost, rmse=np.full(3, np.inf), bias=np.full(3, -1e292))
    before = replace(before, growth=np.full_like(before.growth, 1e6))
    found = replace(
        clean,
        before=before,
        findings=(finding("wind"),),
        errors=(clean.windows.measured,),
        step_residuals=(clean.residuals,),
    )
    page = document_html(diagnosis_document(found))
    text = re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL)
    assert text.count("diverged") >= 3
    assert not re.search(r"\binf\b|e\+\d|100000000", text)
    assert "diverges from the ship" in text
