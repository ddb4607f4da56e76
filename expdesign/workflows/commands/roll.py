"""`expdesign roll`: roll parameters and an unknown load from runs at one or more loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from expdesign import requests
from expdesign.errors import InputError, UnknownName
from expdesign.export import Content, vessel_toml
from expdesign.export.roll_page import RollContent, roll_document, roll_json, roll_sentences
from expdesign.progress import Progress, silent
from expdesign.records import load_records
from expdesign.requests import repeating
from expdesign.roll import (
    TUNING,
    Body,
    Case,
    LowPass,
    RollEstimate,
    Run,
    build_problem,
    estimate_roll,
    fitted_pendulum,
    low_pass,
    null_space,
    prepared,
    roll_frequency,
)
from expdesign.roll.record import planned_everywhere, roll_run
from expdesign.scenario import LoadCases, load_cases
from expdesign.signals import Batch
from expdesign.vessel import Vessel
from expdesign.workflows.outcome import Outcome, finished, workflow
from expdesign.workflows.steps.measured import equipped


@workflow
def roll(request: requests.Roll, *, progress: Progress = silent) -> Outcome:
    """Parameters, intervals and what is not told apart, into `out` or runs/<first data file>.

    Raises:
        InputError: arguments or files that are wrong.
        NoAnswer: the data tell too little.
    """
    progress("reading the data", 0.0)
    ship, told = (None, ()) if request.vessel is None else equipped(request.vessel, request.data)
    known = load_cases(request.loads, ship)
    if len(known.loads) != len(request.data):
        raise InputError(
            f"{request.loads}: load: has {len(known.loads)} load cases for {len(request.data)} data files, "
            "expected one each"
        )
    for path in request.data:
        if sum(path.resolve() == other.resolve() for other in request.data) > 1:
            raise InputError(f"{path}: is given more than once, expected each data file once")
    cases, notes = _cases(request.data, known, request.rudder, ship)
    notes = (*told, *notes)
    filter_ = low_pass(cases, roll_hz=1.0 / known.period_s, cutoff_hz=request.lowpass_hz)
    problem = build_problem(
        known.body, prepared(cases, filter_), beam_m=known.beam_m, roll_hz=1.0 / known.period_s, known=known.known,
        start=known.start,
    )  # fmt: skip
    progress("estimating", 0.3)
    estimate = estimate_roll(problem, method=request.method)
    _check_passed(estimate, filter_)
    notes += _turned(estimate)
    content = RollContent(
        estimate=estimate, report=null_space(estimate), filter=filter_, notes=notes,
        command=repeating(request),
        scale=request.scale,
    )  # fmt: skip
    progress("drawing the page", 0.9)
    document = roll_document(content)
    files: dict[str, Content] = {"roll.json": roll_json(content)}
    if ship is not None:
        files["vessel-roll.toml"] = _fitted(ship, content)
    return finished(request, Path("runs") / request.data[0].stem, files, document, progress, page="roll.html")


def _fitted(ship: Vessel, content: RollContent) -> str:
    """The vessel file of the ship with the estimate."""
    waves = None if ship.pendulum is None else ship.pendulum.waves
    found = replace(ship, pendulum=replace(fitted_pendulum(content.estimate), waves=waves))
    head = ("[roll] is the estimate, of the ship without load, by:", f"    {content.command}", *roll_sentences(content))
    return vessel_toml(found, comments=head)


def _cases(
    data: Sequence[Path], known: LoadCases, rudder: Sequence[str], ship: Vessel | None
) -> tuple[tuple[Case, ...], tuple[str, ...]]:
    """One case for each file, and notes on them."""
    cases: list[Case] = []
    notes: list[str] = []
    step_s = None
    followed = False
    for path, load in zip(data, known.loads, strict=True):
        actuators = () if ship is None else ship.model.actuators
        record = load_records([path], outputs=("r",), sample_time_s=step_s, actuators=actuators)
        step_s = record.batches[0].sample_time_s
        runs = tuple(_run(path, batch, rudder, ship, known.body) for batch in record.batches)
        cases.append(Case(name=path.stem, load=load, runs=runs))
        notes += record.notes
        followed |= any(batch.steered is not None and batch.steered.any() for batch in record.batches)
    if planned_everywhere([run for case in cases for run in case.runs]):
        return tuple(cases), (*notes, AS_PLANNED)
    cases = [replace(case, runs=tuple(replace(run, planned=None) for run in case.runs)) for case in cases]
    return tuple(cases), (*notes, *((FOLLOWED,) if followed else ()))


AS_PLANNED = "Instruments come from the rudder as planned (planned_...), so that a helm may answer the ship."
FOLLOWED = (
    "Samples are marked as steered, and no planned_... columns tell what the rudder would have done by itself: "
    "instruments come from the rudder, which is right only where it does not answer roll."
)


def _run(path: Path, batch: Batch, rudder: Sequence[str], ship: Vessel | None, body: Body) -> Run:
    try:
        return roll_run(batch, rudder=rudder, ship=ship, body=body)
    except UnknownName:
        raise
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _turned(estimate: RollEstimate) -> tuple[str, ...]:
    """A note where the model misses something, and misses nothing with the other sign of the accelerometer."""
    if not estimate.surprise > TUNING.most_surprise:
        return ()
    cases = [
        replace(case, runs=tuple(replace(run, signals=run.signals * [1.0, -1.0, 1.0, 1.0]) for run in case.runs))
        for case in estimate.problem.cases
    ]
    other = estimate_roll(replace(estimate.problem, cases=tuple(cases)), method=estimate.method)
    if other.surprise > TUNING.most_surprise or other.reached:
        return ()
    return (
        "imu_lateral_mps2 or roll_rate_radps seems to have the wrong sign, both expected positive to starboard: "
        f"residuals follow the rudder {estimate.surprise:.2g} times as much as noise would, and {other.surprise:.2g} "
        "times with one of the two turned.",
    )


def _check_passed(estimate: RollEstimate, used: LowPass) -> None:
    """Raise where the filter takes from the roll that was found."""
    for case in estimate.problem.cases:
        found = roll_frequency(estimate.theta, estimate.problem.body, case.load)
        if used.gain(found) < TUNING.passed_gain:
            raise InputError(
                f"the low-pass filter leaves {100 * used.gain(found):.0f} % of the roll that was found, {found:.3g} Hz "
                f"in {case.name}, expected {100 * TUNING.passed_gain:.0f} % or more; set --lowpass-hz {4 * found:.2g}, "
                "or period_s to what it is"
            )
