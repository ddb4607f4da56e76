"""A current, a dead time and orders between rows pass into the parameters of who does not know of them, and are told.

The ship is that of the bridge log. Her orders are given ten times a second, and read once a second.
"""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from expdesign.assessment import Assessment, EstimateOptions, assess, settled, with_unstated
from expdesign.assessment.unstated import _surest
from expdesign.errors import Diverged
from expdesign.estimation.methods import Method
from expdesign.estimation.output_error import ActuatorTime
from expdesign.export.files import answer_sentence, current_sentence, estimate_json, estimated_vessel
from expdesign.reduction import reduced
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Commands, Record
from expdesign.simulation import Environment, measure, simulate
from expdesign.vessel import Vessel, with_response_values
from scenario_files import SCENARIOS

SHIP = load_vessel(SCENARIOS / "vessels" / "logged-50m.toml")
FINE_S, ROW = 0.1, 10
OPTIONS = EstimateOptions(methods=("oe",), mean="none")
UNKNOWN = {
    "a current and orders of the helm between rows": {"current_to": (-0.5, 0.0), "helm_later_s": 0.5},
    "nothing": {},
    "orders of the helm between rows": {"helm_later_s": 0.4},
    "orders of the engine between rows": {"engine_later_s": 0.3},
    "a dead time of the helm": {"rudder1_delay_s": 0.9},
    "a current": {"current_to": (0.3, -0.4)},
}


def run(
    seed: int,
    *,
    helm_later_s: float = 0.0,
    engine_later_s: float = 0.0,
    current_to: tuple[float, float] = (0.0, 0.0),
    **times: float,
) -> Record:
    """Helm and engine to any level every 20 s, so much later than a row, with the noise of her sensors."""
    rng, holds, held = np.random.default_rng(seed), 24, round(20 / FINE_S)
    engine = np.repeat(rng.uniform(1.5, 3.5, holds), held)
    helm = np.roll(np.repeat(rng.choice([-1.0, 1.0], holds) * rng.uniform(0.15, 0.5, holds), held), held // 2)
    later = [round(time / FINE_S) for time in (engine_later_s, helm_later_s)]
    values = np.stack([np.roll(engine, later[0]), np.roll(helm, later[1])], axis=1)
    commands = Commands(sample_time_s=FINE_S, names=("n1", "rudder1"), values=values)
    actuators = with_response_values(SHIP.actuators, times)
    truth = replace(SHIP, model=replace(SHIP.model, actuators=actuators))
    sea = Environment(current_to=np.array(current_to))
    motion = simulate(truth, commands, velocity=(5.0 + current_to[0], current_to[1], 0.0), environment=sea)
    seen = {name: column[::ROW] for name, column in measure(truth, commands, motion, environment=sea, rng=rng).items()}
    batch = Batch(
        name=f"run-{seed}", sample_time_s=FINE_S * ROW, input_names=commands.names, inputs=values[::ROW],
        velocity=np.stack([seen["u_mps"], seen["v_mps"], seen["r_radps"]], axis=1),
        pose=np.stack([seen["north_m"], seen["east_m"], np.unwrap(seen["heading_rad"])], axis=1),
    )  # fmt: skip
    return Record(batches=(batch,))


def found(raw: Record, ship: Vessel = SHIP, *, methods: tuple[str, ...] = ("oe",)) -> Assessment:
    """Estimates, of output error unless told otherwise, and what it shows beside."""
    options = replace(OPTIONS, methods=methods)
    return with_unstated(ship, raw, options, assess(ship, reduced(raw, ship), options))


def surprise(told: Assessment) -> float:
    """The largest error of the estimate in its standard deviations."""
    held, truth = told.best.estimate, dict(zip(SHIP.model.names, SHIP.model.parameters, strict=True))
    return max(abs(held.value(name) - truth[name]) / std for name, std in zip(held.names, held.std, strict=True))


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[] if number == 0 else pytest.mark.thorough) for number, kind in enumerate(UNKNOWN)],
)
def test_what_nobody_stated_is_told_with_its_size(kind: str) -> None:
    unknown = UNKNOWN[kind]
    told = found(run(1, **unknown))
    row_s = FINE_S * ROW
    late = {}
    for signal, given, delay in (
        ("n1", "engine_later_s", "n1_delay_s"),
        ("rudder1", "helm_later_s", "rudder1_delay_s"),
    ):
        # an order that was given after a row is shown by the next one
        time_s = unknown[given] - row_s if given in unknown else unknown.get(delay, 0.0)
        late |= {signal: time_s} if time_s else {}
    named = {answer.signal for answer in told.answers}
    assert named <= set(late)
    if named < set(late):  # what is not told does no harm
        assert surprise(told) < 4
    for answer in told.answers:
        assert abs(answer.late_s - late[answer.signal]) < 4 * answer.std_s
        sentence = answer_sentence(answer)
        assert ("sooner" in sentence) == (late[answer.signal] < 0)
        assert f"{answer.moved.parameter} by {answer.moved.by_std:.0f} of its standard deviations" in sentence
    if "current_to" not in unknown:
        assert told.current is None
        return
    assert told.current is not None
    north, east = unknown["current_to"]
    assert np.hypot(told.current.north_mps - north, told.current.east_mps - east) < 5 * told.current.std_mps
    toward = np.degrees(np.arctan2(told.current.east_mps, told.current.north_mps)) % 360
    said = current_sentence(told.current)
    assert f"towards {toward:.0f} deg" in said
    for text in (estimate_json(told, SHIP), estimated_vessel(told, SHIP, command="estimate").replace("\n# ", " ")):
        assert said in text, "who reads the file is not told"


@pytest.mark.parametrize(
    ("method", "late_s"),
    [("ls", 6.0), *(pytest.param("oe", size, marks=pytest.mark.thorough) for size in (2.0, 3.5, 6.0))],
)
def test_dead_times_of_many_rows_are_told_in_their_size(method: str, late_s: float) -> None:
    """An estimate is linear in a dead time about the one that orders are delivered with; of 6 s it first finds 4.6."""
    (answer,) = found(run(1, rudder1_delay_s=late_s), methods=(method,)).answers
    assert answer.signal == "rudder1"
    assert abs(answer.late_s - late_s) < 4 * answer.std_s < 0.2


def test_a_dead_time_that_does_not_settle_is_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    unstated = import_module("expdesign.assessment.unstated")
    monkeypatch.setattr(unstated, "MOST_DELIVERIES", 1)
    told = found(run(1, rudder1_delay_s=6.0), methods=("ls",))
    assert not told.answers
    (note,) = [text for text in told.notes if "inputs are answered" in text]
    assert note == f"Whether inputs are answered when the vessel file says is not known: {unstated.UNSETTLED}."


@pytest.mark.parametrize("methods", [("ls",), pytest.param(("ls", "iv"), marks=pytest.mark.thorough)])
def test_other_methods_are_biased_alike_and_tell_the_same(methods: tuple[str, ...]) -> None:
    told = found(run(1, helm_later_s=0.4), methods=methods)
    assert surprise(told) > 5
    (answer,) = told.answers
    assert answer.signal == "rudder1"
    assert abs(answer.late_s - (0.4 - FINE_S * ROW)) < 4 * answer.std_s
    assert told.current is None


@pytest.mark.parametrize("methods", [("ls",), pytest.param(("oe",), marks=pytest.mark.thorough)])
def test_estimates_joined_with_a_prior_are_compared_with_such(methods: tuple[str, ...]) -> None:
    sure = replace(SHIP.model, parameter_std=1e-6 * np.abs(SHIP.model.parameters))
    ship, raw = replace(SHIP, model=sure), run(1, current_to=(0.3, -0.4))
    options = replace(OPTIONS, methods=methods, prior="parameter_std")
    told = with_unstated(ship, raw, options, assess(ship, reduced(raw, ship), options))
    assert told.current is None  # nothing moves what is known so well
    assert found(raw, SHIP, methods=methods).current is not None


def test_what_could_not_be_asked_is_told_and_the_rest_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    assessing = import_module("expdesign.assessment.assess")
    raw, attempted = run(1, current_to=(0.3, -0.4)), assessing.attempted
    options = replace(OPTIONS, methods=("ls",))
    done = assess(SHIP, reduced(raw, SHIP), options)

    def told(fails: Callable[[Method, tuple[ActuatorTime, ...]], bool]) -> Assessment:
        def attempt(work, ship, record, method, **given):
            if fails(method, given.get("times", ())):
                raise Diverged("it ran away")
            return attempted(work, ship, record, method, **given)

        monkeypatch.setattr(assessing, "attempted", attempt)
        return with_unstated(SHIP, raw, options, done)

    no_current = told(lambda method, times: method.weather.steady)
    assert no_current.notes == ("Whether there is a current that nobody stated is not known: it ran away.",)
    assert no_current.current is None
    no_answers = told(lambda method, times: bool(times))
    assert no_answers.notes == ("Whether inputs are answered when the vessel file says is not known: it ran away.",)
    assert no_answers.current is not None
    neither = told(lambda method, times: True)
    assert neither.notes == ("Whether there is a current or a dead time that nobody stated is not known: it ran away.",)
    assert neither.best.estimate is done.best.estimate
    monkeypatch.setattr(assessing, "MOST_BY_ITSELF", 100)
    long = told(lambda method, times: False)
    assert long.current is None
    (note,) = long.notes  # not in silence
    assert "is not known: only output error tells, asked for by --method oe" in note


@pytest.mark.thorough
def test_what_is_told_moves_the_estimate_from_the_truth() -> None:
    """Without it parameters are wrong by far more than they say; what is stated as unknown is not told again."""
    raw = run(1, helm_later_s=0.4)
    assert surprise(found(raw)) > 5
    stated = replace(SHIP, std={"rudder1_delay_s": 1.0})
    assert not found(raw, stated).answers


@pytest.mark.thorough
@pytest.mark.parametrize(("later_s", "early"), [(0.4, True), (0.0, False)])
def test_orders_that_were_read_late_are_told_where_the_dead_time_is_estimated_too(later_s: float, early: bool) -> None:
    """Without a dead time she answers 0.6 s before the row that shows her order; output error counts that."""
    stated = replace(SHIP, std={"rudder1_delay_s": 1.0})
    now, record = settled(stated, run(1, helm_later_s=later_s), OPTIONS)
    told = assess(now, record, OPTIONS, stated=stated)
    (note,) = [text for text in told.best.estimate.warnings if "rudder1_delay_s" in text]
    assert ("The ship answers before the recorded orders, which were read late: rudder1 0." in note) == early
    assert surprise(told) < 4


@pytest.mark.thorough
@pytest.mark.parametrize("solver", ["oe", "iv"])
@pytest.mark.parametrize("current_to", [(0.3, -0.4), (-0.6, 0.1)])
def test_a_method_that_knows_the_current_predicts_with_it_and_is_taken(
    solver: str, current_to: tuple[float, float]
) -> None:
    """In the frame of the water; over ground its true parameters predict worse than wrong ones."""
    raw = Record(batches=tuple(run(seed, current_to=current_to).batches[0] for seed in (1, 2)))
    options = replace(OPTIONS, methods=(solver, f"{solver}-current"))
    told = assess(SHIP, reduced(raw, SHIP), options)
    least = {item.method.name: item.share for item in sorted(told.compared, key=lambda item: -item.share)}
    assert least[f"{solver}-current"] < least[solver] / 2
    assert told.best.method.name == f"{solver}-current"
    assert surprise(told) < 4.5
    still = Record(batches=tuple(run(seed).batches[0] for seed in (1, 2)))
    compared = assess(SHIP, reduced(still, SHIP), options).compared
    least = {item.method.name: item.share for item in sorted(compared, key=lambda item: -item.share)}
    assert least[f"{solver}-current"] == pytest.approx(least[solver], rel=0.05)


@pytest.mark.thorough
def test_of_runs_without_anything_unknown_few_are_told_of() -> None:
    """Each of two times and a current passes three standard deviations in 3 of 1000 runs: of 20, at most 2."""
    told = [found(run(seed)) for seed in range(100, 120)]
    assert sum(bool(one.answers) or one.current is not None for one in told) <= 2


def test_what_is_no_number_is_told_as_nothing():
    assert _surest(np.array([1.0, 1.0]), np.array([[np.nan, 0.0], [0.0, 1.0]])) == []
    assert [index for index, *_ in _surest(np.array([1.0, 4.0]), np.eye(2))] == [1]
