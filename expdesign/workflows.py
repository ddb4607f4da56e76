"""The story of the package: from a scenario file to a folder of results, one function for each command.

Each function reads its input, does the work and only then writes, so that a failure leaves no files. The pieces in
between (`scored`, `designed`, `planned`) are for notebooks: value in, value out.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from expdesign import __version__
from expdesign.assessment import NO_TESTS, Assessment, Wish, assess
from expdesign.conventions import Array
from expdesign.dictionary import build_dictionary
from expdesign.durations import DurationDesign, build_durations, solve_durations, with_repeats
from expdesign.errors import FileError, InputError
from expdesign.export import (
    FORMATS,
    build_route,
    commands_csv,
    dictionary_json,
    durations_json,
    estimate_json,
    estimate_warnings,
    estimated_vessel,
    find_format,
    fit_entries,
    fit_table,
    parameter_entries,
    parameter_table,
    plan_json,
    planned_track,
    read_plan,
    route_files,
    track_csv,
    write_files,
)
from expdesign.export.estimate_page import EstimateContent, estimate_html
from expdesign.export.report import ReportContent, report_html
from expdesign.information import PrimitiveInformation, estimated_parameters, score_primitives
from expdesign.plan.solve import PlanProblem, plan_trial
from expdesign.plan.values import Plan
from expdesign.records import load_records
from expdesign.scenario import Scenario, load_repeats, load_scenario, load_vessel
from expdesign.signals import Record
from expdesign.simulation import draw_environment, measure
from expdesign.simulation import simulate as simulate_run
from expdesign.vessel import Vessel, column_name
from expdesign.vessel.structures import FORCE_SIGNALS

Progress = Callable[[str, float], None]
"""(what is being done, share of the command done from 0 to 1)."""


def silent(what: str, share: float) -> None:
    """Progress that nobody looks at."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a command leaves behind.

    Attributes:
        files: written, in the order of their contents.
        summary: key numbers, ready for JSON; units in the names.
        tables: the same for people where key numbers are many.
    """

    files: tuple[Path, ...]
    summary: Mapping[str, object]
    tables: tuple[TextTable, ...] = ()


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """A table for a terminal.

    Attributes:
        title: what it shows.
        header: names of the columns.
        rows: as many cells each.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def run(scenario: Path, out: Path | None, *, seed: int = 0, progress: Progress = silent) -> Outcome:
    """The main job: score, durations, plan, verification, route files and report, into `out` or runs/<scenario>."""
    case = _load(scenario, progress)
    information = scored(case, progress=_within(progress, 0.02, 0.08))
    progress("sharing out time", 0.08)
    design = designed(case, information)
    plan = planned(case, information, design, seed=seed, progress=_within(progress, 0.1, 0.85))
    progress("writing routes and report", 0.85)
    files = {
        **_dictionary_files(case, information),
        "durations.json": durations_json(design, criterion=case.design.criterion),
        **_plan_files(case, plan),
        **_route_files(case, plan),
        "report.html": report_html(_report(case, information, design, plan, seed)),
    }
    return _written(case, out, files, {**_design_summary(design), **_plan_summary(plan)}, progress)


def score(scenario: Path, out: Path | None, *, seed: int = 0, progress: Progress = silent) -> Outcome:
    """Information of every primitive of a scenario's dictionary."""
    case = _load(scenario, progress)
    information = scored(case, progress=_within(progress, 0.05, 0.95))
    summary = {
        "primitives": len(information),
        "parameters": len(_parameters(case)),
        "meet_excitation_condition": sum(item.excitation_condition for item in information),
        "informative_alone": sum(item.log_det_alone is not None for item in information),
    }
    return _written(case, out, _dictionary_files(case, information), summary, progress)


def durations(scenario: Path, out: Path | None, *, seed: int = 0, progress: Progress = silent) -> Outcome:
    """How long to run each primitive, with its certificate."""
    case = _load(scenario, progress)
    information = scored(case, progress=_within(progress, 0.05, 0.9))
    design = designed(case, information)
    files = {"durations.json": durations_json(design, criterion=case.design.criterion)}
    return _written(case, out, files, _design_summary(design), progress)


def plan(
    scenario: Path, out: Path | None, *, durations: Path | None = None, seed: int = 0, progress: Progress = silent
) -> Outcome:
    """One verified trajectory with the runs of a durations file, or of the optimal durations."""
    case = _load(scenario, progress)
    information = scored(case, progress=_within(progress, 0.02, 0.08))
    design = designed(case, information)
    if durations is not None:
        design = with_repeats(design, load_repeats(durations, names=design.problem.names))
    result = planned(case, information, design, seed=seed, progress=_within(progress, 0.1, 0.95))
    return _written(case, out, _plan_files(case, result), _plan_summary(result), progress)


def export(plan: Path, out: Path | None, *, formats: Sequence[str], progress: Progress = silent) -> Outcome:
    """Route files of a plan made before, into `out` or beside it."""
    if not formats:
        raise InputError(f"no route format is named; there are {', '.join(item.name for item in FORMATS)}")
    for name in formats:
        find_format(name)
    progress("reading the plan", 0.1)
    route = build_route(read_plan(plan))
    files = write_files(out or plan.parent, route_files(route, tuple(dict.fromkeys(formats))))
    return Outcome(files=files, summary={"waypoints": len(route.waypoints), "length_m": route.length_m})


def simulate(plan: Path, out: Path | None, *, truth: Path, seed: int = 0, progress: Progress = silent) -> Outcome:
    """The commands of a plan run open loop on another vessel in drawn weather, and what its sensors record."""
    progress("reading the plan", 0.05)
    track, vessel = read_plan(plan), load_vessel(truth)
    if (vessel.model.inputs, vessel.sample_time_s) != (track.commands.names, track.commands.sample_time_s):
        raise FileError(
            truth,
            "actuators",
            f"takes {', '.join(vessel.model.inputs)} every {vessel.sample_time_s:g} s, the plan commands "
            f"{', '.join(track.commands.names)} every {track.commands.sample_time_s:g} s",
        )
    rng = np.random.default_rng(seed)
    weather = draw_environment(track.environment, rng)
    progress("simulating the trial", 0.2)
    begin = track.trajectory
    sailed = simulate_run(vessel, track.commands, pose=begin.pose[0], velocity=begin.velocity[0], environment=weather)
    columns = measure(vessel, track.commands, sailed, environment=weather, rng=rng)
    apart = np.hypot(*(sailed.pose - begin.pose)[:, :2].T)
    files = write_files(out or plan.parent, {"measured.csv": _csv(columns)})
    summary = {
        "trial_s": track.commands.duration_s,
        "samples": len(track.commands),
        "farthest_from_plan_m": float(apart.max()),
        "current_to_north_mps": float(weather.current_to[0]),
        "current_to_east_mps": float(weather.current_to[1]),
        "wind_to_north_mps": float(weather.wind_to[0]),
        "wind_to_east_mps": float(weather.wind_to[1]),
    }
    return Outcome(files=files, summary=summary)


def estimate(
    data: Sequence[Path],
    out: Path | None,
    *,
    vessel: Path,
    methods: Sequence[str] = (),
    fixed: Sequence[str] = (),
    velocity: str = "auto",
    mean: str = "complete",
    start: str = "auto",
    tests: Sequence[Path] = (),
    progress: Progress = silent,
) -> Outcome:
    """Parameters of a vessel from measured data, into `out` or runs/<first data file>."""
    if not data:
        raise InputError("no data files are given, expected one or more CSV files")
    for path in tests:
        if path in data:
            raise InputError(f"{path} is given for estimation and for testing, expected one of the two")
    progress("reading the data", 0.02)
    ship = load_vessel(vessel)
    wish = Wish(methods=tuple(methods), fixed=tuple(fixed), mean=mean, start=start)
    record = measured(data, ship, velocity=velocity)
    apart = measured(tests, ship, velocity=velocity) if tests else NO_TESTS
    found = assess(ship, record, wish, tests=apart, progress=_within(progress, 0.1, 0.8))
    progress("drawing the report", 0.8)
    command = _estimate_command(data, vessel, wish, velocity, tests)
    files = {
        "estimate.json": estimate_json(found, ship),
        "vessel-estimated.toml": estimated_vessel(found, ship, command=command),
        "estimate.html": estimate_html(EstimateContent(vessel=ship, found=found, command=command, version=__version__)),
    }
    written = write_files(out or Path("runs") / data[0].stem, files)
    progress("done", 1.0)
    return Outcome(files=written, summary=_estimate_summary(found), tables=_estimate_tables(found))


def measured(data: Sequence[Path], vessel: Vessel, *, velocity: str = "auto") -> Record:
    """Measured data of a vessel: its own actuators' signals, or generalised forces where the first file has those.

    A model in discrete form holds for one sample time, which the data must have; in continuous form any will do.
    """
    inputs, header = vessel.model.inputs, _header(data[0])
    if not {column_name(name) for name in inputs} <= header and set(FORCE_SIGNALS) <= header:
        inputs = FORCE_SIGNALS
    return load_records(
        list(data),
        vessel_inputs=inputs,
        sample_time_s=vessel.sample_time_s if vessel.model.form == "discrete" else None,
        velocity=velocity,
        heading_std_rad=vessel.sensors.heading_rad or None,
        outputs=vessel.model.outputs,
    )


def scored(case: Scenario, *, progress: Progress = silent) -> tuple[PrimitiveInformation, ...]:
    """Information of every primitive of a scenario."""
    progress("simulating the dictionary", 0.0)
    primitives = build_dictionary(case.vessel, case.dictionary)
    progress("scoring the dictionary", 0.5)
    return score_primitives(
        case.vessel,
        primitives,
        environment=case.environment,
        fixed_parameters=case.design.fixed_parameters,
        mean_subtraction=case.design.mean_subtraction,
    )


def designed(case: Scenario, information: Sequence[PrimitiveInformation]) -> DurationDesign:
    """The certified durations of a scored scenario."""
    return solve_durations(
        build_durations(
            information,
            _parameters(case),
            total_s=case.design.total_s,
            mean_subtraction=case.design.mean_subtraction,
        )
    )


def planned(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    design: DurationDesign,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Plan:
    """The verified trial of a scenario."""
    problem = PlanProblem(
        vessel=case.vessel,
        area=case.area,
        environment=case.environment,
        settings=case.plan,
        primitives=tuple(item.primitive for item in information),
        design=design,
        start=case.start,
        goal=case.goal,
        seed=seed,
    )
    return plan_trial(problem, progress=progress)


def _load(scenario: Path, progress: Progress) -> Scenario:
    progress("reading the scenario", 0.0)
    return load_scenario(scenario)


def _parameters(case: Scenario) -> tuple[str, ...]:
    return estimated_parameters(case.vessel.model, case.design.fixed_parameters)


def _within(progress: Progress, low: float, high: float) -> Progress:
    return lambda what, share: progress(what, low + (high - low) * share)


def _written(
    case: Scenario,
    out: Path | None,
    files: Mapping[str, str | bytes],
    summary: Mapping[str, object],
    progress: Progress,
) -> Outcome:
    written = write_files(out or Path("runs") / case.name, files)
    progress("done", 1.0)
    return Outcome(files=written, summary={"scenario": case.name, **summary})


def _dictionary_files(case: Scenario, information: Sequence[PrimitiveInformation]) -> dict[str, str | bytes]:
    return {"dictionary.json": dictionary_json(information, _parameters(case), vessel=case.vessel)}


def _plan_files(case: Scenario, plan: Plan) -> dict[str, str | bytes]:
    return {
        "plan.json": plan_json(
            plan,
            scenario=case.name,
            vessel=case.vessel,
            environment=case.environment,
            clearance_m=case.plan.clearance_m,
        ),
        "track.csv": track_csv(plan),
        "commands.csv": commands_csv(plan),
    }


def _route_files(case: Scenario, plan: Plan) -> dict[str, bytes]:
    track = planned_track(
        plan,
        scenario=case.name,
        vessel=case.vessel,
        environment=case.environment,
        clearance_m=case.plan.clearance_m,
    )
    route = build_route(track, safe_water=case.area.water)
    return route_files(route, [item.name for item in FORMATS])


def _report(
    case: Scenario, information: tuple[PrimitiveInformation, ...], design: DurationDesign, plan: Plan, seed: int
) -> ReportContent:
    return ReportContent(
        scenario=case.name,
        vessel=case.vessel,
        environment=case.environment,
        start=case.start,
        goal=case.goal,
        criterion=case.design.criterion,
        fixed_parameters=case.design.fixed_parameters,
        clearance_m=case.plan.clearance_m,
        confidence=case.plan.confidence,
        information=information,
        design=design,
        plan=plan,
        command=f"expdesign run {case.path} --seed {seed}",
        version=__version__,
    )


def _header(path: Path) -> set[str]:
    """Names in the first row; empty where the file cannot be read, of which the reader will complain."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            return {cell.strip(' "') for cell in re.split("[,;\t]", file.readline().strip())}
    except (OSError, UnicodeDecodeError):
        return set()


def _estimate_command(data: Sequence[Path], vessel: Path, wish: Wish, velocity: str, tests: Sequence[Path]) -> str:
    options = [("--method", wish.methods), ("--fixed", wish.fixed), ("--test", tests)]
    spelled = [part for option, values in options if values for part in (option, *map(str, values))]
    chosen = [("--velocity", velocity, "auto"), ("--mean", wish.mean, "complete"), ("--start", wish.start, "auto")]
    spelled += [part for option, value, usual in chosen if value != usual for part in (option, value)]
    return shlex.join(["expdesign", "estimate", *map(str, data), "--vessel", str(vessel), *spelled])


def _estimate_summary(found: Assessment) -> dict[str, object]:
    batches = found.record.batches
    return {
        "runs": len(batches),
        "samples": sum(len(batch) for batch in batches),
        "runs_kept_apart": len(found.tests.batches),
        "vessel_file_holds": found.best.method.name,
        "methods_left_out": list(found.left_out),
        "methods": {
            item.method.name: {
                "parameters": parameter_entries(item),
                "fit": fit_entries(item),
                "warnings": len(estimate_warnings(found, item)),
            }
            for item in found.methods
        },
    }


def _estimate_tables(found: Assessment) -> tuple[TextTable, ...]:
    tables = (
        ("Estimates, with standard deviations", parameter_table(found)),
        ("Fit of the simulated output to the measured one, in per cent", fit_table(found)),
    )
    return tuple(TextTable(title=title, header=header, rows=tuple(rows)) for title, (header, rows) in tables)


def _design_summary(design: DurationDesign) -> dict[str, object]:
    chosen = {name: count for name, count in zip(design.problem.names, design.repeats, strict=True) if count}
    return {
        "runs": chosen,
        "certificate_gap": design.gap_relative,
        "efficiency_of_whole_runs": design.efficiency_repeats,
        "efficiency_of_equal_shares": design.efficiency_uniform,
    }


def _plan_summary(plan: Plan) -> dict[str, object]:
    return {
        "verified": plan.verification.verified,
        "informative_s": plan.seconds("primitive"),
        "repositioning_s": plan.seconds("reposition"),
        "repositioning_bound_s": plan.reposition_bound_s,
        "distance_m": plan.trajectory.distance_m,
        "least_clearance_m": plan.verification.clearance_min_m,
        "leave_water_probability": plan.leave_water_probability,
        "design_efficiency_realised": plan.design_efficiency_realised,
    }


def _csv(columns: Mapping[str, Array]) -> str:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{value:.10g}" for value in row) for row in rows)]) + "\n"


__all__ = [
    "Outcome",
    "Progress",
    "TextTable",
    "designed",
    "durations",
    "estimate",
    "export",
    "measured",
    "plan",
    "planned",
    "run",
    "score",
    "scored",
    "simulate",
]
