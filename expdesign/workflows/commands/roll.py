"""`expdesign roll`: roll parameters and an unknown load from runs; `expdesign incline`: what inclining tests tell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from expdesign import requests
from expdesign.errors import FileError, InputError, NoAnswer, UnknownName
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import finite, strict_json, vessel_toml
from expdesign.export.folder import Content
from expdesign.export.roll_page import RollContent, roll_document, roll_json, roll_sentences
from expdesign.loading import Inclining, heel_in_waves, inclining
from expdesign.progress import Progress, silent
from expdesign.records import load_records
from expdesign.requests import repeating
from expdesign.roll import (
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
from expdesign.roll.regression import MOST_SURPRISE
from expdesign.roll.runs import PASSED_GAIN
from expdesign.scenario import LoadCases, load_cases, load_vessel
from expdesign.signals import Batch
from expdesign.vessel import RollPendulum, Vessel
from expdesign.workflows.outcome import Outcome, finished, results_folder, workflow
from expdesign.workflows.steps.measured import equipped

HEADER = ("mass [kg]", "shift [m]", "heel [deg]", "std of GM [m]", "std of GM [%]", "std of inertia [%]")


@workflow
def incline(request: requests.Incline, *, progress: Progress = silent) -> Outcome:
    """A row for every mass and shift, into incline.json in `out` or runs/<vessel>-incline.

    Raises:
        InputError: the file has no [roll], or a number is not positive.
        NoAnswer: the ship does not stay upright.
    """
    ship = load_vessel(request.vessel)
    folder = results_folder(request, f"{ship.name}-incline")
    pendulum = ship.pendulum
    if pendulum is None:
        raise FileError(request.vessel, "roll", "is missing, expected a table [roll] with masses and heights")
    if not pendulum.righting_nm > 0:
        raise NoAnswer(
            f"{ship.name} does not stay upright: her metacentric height is {pendulum.metacentric_height_m:.3g} m"
        )
    pairs = [(mass, shift) for mass in request.mass_kg for shift in request.shift_m]
    rolling, left = (math.degrees(one) for one in heel_in_waves(pendulum, request.read_s))
    left *= math.sqrt(2.0)  # a change of heel is that of two readings
    heel_in_all_deg = math.hypot(request.heel_std_deg, left) if request.heel_std_deg > 0 else request.heel_std_deg
    found = [_tested(pendulum, pair, heel_in_all_deg, request.period_std_s, request.shifts) for pair in pairs]
    rows = [
        {"mass_kg": mass, "shift_m": shift, **{name: finite(value) for name, value in asdict(one).items()}}
        for (mass, shift), one in zip(pairs, found, strict=True)
    ]
    summary = {
        "displacement_kg": pendulum.body.mass_kg + pendulum.load.mass_kg,
        "metacentric_height_m": pendulum.metacentric_height_m,
        "period_s": pendulum.period_s,
    }
    if pendulum.waves is not None:
        summary |= {"roll_in_waves_deg": rolling, "left_of_waves_deg": left, "read_s": request.read_s}
    told = (
        ()
        if pendulum.waves is None
        else _in_waves(rolling, left, request.read_s, request.heel_std_deg, request.period_std_s)
    )
    files = {"incline.json": strict_json({**summary, "tests": rows, "remarks": list(told)})}
    table = [_row(pendulum, pair, one) for pair, one in zip(pairs, found, strict=True)]
    tests = Table(title="Inclining tests", header=HEADER, rows=tuple(table))
    document = Document(facts=summary, findings=told, sections=tabled(tests))
    return finished(request, folder, files, document, progress)


def _in_waves(
    rolling: float, left: float, read_s: float, heel_std_deg: float, period_std_s: float | None
) -> tuple[str, ...]:
    """What the waves of the vessel file do to readings of heel [deg] and to a decay."""
    heel = (
        f"The waves of [roll.waves] roll her by {rolling:.2g} degrees rms, beam on. Averaged over {read_s:g} s they "
        f"leave {left:.2g} degrees in a change of heel, which count beside the {heel_std_deg:g} degrees of the reading."
    )
    decay = "They disturb a decay, too: --period-std-s must hold what they do to the period."
    return (heel,) if period_std_s is None else (heel, decay)


def _tested(
    pendulum: RollPendulum, pair: tuple[float, float], heel_std_deg: float, period_std_s: float | None, shifts: int
) -> Inclining:
    return inclining(
        mass_kg=pair[0], shift_m=pair[1], displacement_kg=pendulum.body.mass_kg + pendulum.load.mass_kg,
        metacentric_height_m=pendulum.metacentric_height_m, period_s=pendulum.period_s,
        heel_std_rad=math.radians(heel_std_deg), period_std_s=math.inf if period_std_s is None else period_std_s,
        shifts=shifts,
    )  # fmt: skip


def _row(pendulum: RollPendulum, pair: tuple[float, float], one: Inclining) -> tuple[str, ...]:
    share = one.inertia_std_kgm2 / one.inertia_kgm2
    return (
        f"{pair[0]:g}", f"{pair[1]:g}", f"{math.degrees(one.heel_rad):.2f}", f"{one.metacentric_height_std_m:.2g}",
        f"{100 * one.metacentric_height_std_m / pendulum.metacentric_height_m:.2g}",
        f"{100 * share:.2g}" if math.isfinite(share) else "no decay",
    )  # fmt: skip


@workflow
def roll(request: requests.Roll, *, progress: Progress = silent) -> Outcome:
    """Parameters, intervals and what is not told apart, into `out` or runs/<first data file>.

    Raises:
        InputError: arguments or files that are wrong.
        NoAnswer: the data tell too little.
    """
    folder = results_folder(request, request.data[0].stem)
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
    return finished(request, folder, files, document, progress, page="roll.html")


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
    if not estimate.surprise > MOST_SURPRISE:
        return ()
    cases = [
        replace(case, runs=tuple(replace(run, signals=run.signals * [1.0, -1.0, 1.0, 1.0]) for run in case.runs))
        for case in estimate.problem.cases
    ]
    other = estimate_roll(replace(estimate.problem, cases=tuple(cases)), method=estimate.method)
    if other.surprise > MOST_SURPRISE or other.reached:
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
        if used.gain(found) < PASSED_GAIN:
            raise InputError(
                f"the low-pass filter leaves {100 * used.gain(found):.0f} % of the roll that was found, {found:.3g} Hz "
                f"in {case.name}, expected {100 * PASSED_GAIN:.0f} % or more; set --lowpass-hz {4 * found:.2g}, "
                "or period_s to what it is"
            )
