"""`expdesign estimate`: parameters of a vessel from measured data."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from expdesign import __version__
from expdesign.assessment import NO_TESTS, Assessment, EstimateOptions, assess, settled
from expdesign.errors import InputError
from expdesign.export import (
    Content,
    disturbance_table,
    estimate_json,
    estimate_warnings,
    estimated_vessel,
    failure_rows,
    fit_entries,
    fit_table,
    limit_entries,
    limit_table,
    parameter_entries,
    parameter_table,
    prediction_entries,
    prediction_table,
    prediction_title,
    rows_entry,
    steered_entry,
    write_files,
)
from expdesign.export.estimate_page import EstimateContent, estimate_html, estimate_notes
from expdesign.progress import Progress, silent, within
from expdesign.workflows.outcome import Outcome, TextTable, command_text, note_on_roll
from expdesign.workflows.steps.measured import data_files, doubted, equipped, measured, reduced_data
from expdesign.workflows.steps.workers import workers

STEERED_WORDS = {"use": "used", "leave-out": "left out", "planned": "instruments from planned inputs"}


def estimate(
    data: Sequence[Path],
    out: Path | None,
    *,
    vessel: Path,
    methods: Sequence[str] = (),
    fixed: Sequence[str] = (),
    velocity: str = "auto",
    mean: str = "complete",
    blocks: str = "one",
    start: str = "auto",
    motion: str = "continuous",
    horizon_s: float | None = None,
    constant: bool = False,
    steered: str = "auto",
    samples: str = "all",
    offset_mps: float = 0.0,
    prior: str = "none",
    tests: Sequence[Path] = (),
    progress: Progress = silent,
) -> Outcome:
    """Parameters of a vessel from measured data, into `out` or runs/<first data file>."""
    if not data:
        raise InputError("no data files are given, expected one or more CSV files")
    used = data_files(data)
    for path in data_files(tests):
        if path in used:
            raise InputError(f"{path} is given for estimation and for testing, expected only one of them")
    progress("reading the data", 0.0)
    ship, told = equipped(vessel, [*data, *tests])
    options = EstimateOptions(
        methods=tuple(methods),
        fixed=tuple(fixed),
        mean=mean,
        blocks=blocks,
        start=start,
        motion=motion,
        horizon_s=horizon_s,
        constant=constant,
        steered=steered,
        samples=samples,
        offset_mps=offset_mps,
        prior=prior,
    )
    raw = measured(data, ship, velocity=velocity, told=told)
    with workers(0, load=None), doubted(raw):
        now, record = settled(ship, raw, options, smoothed=velocity == "smoothed", progress=within(progress, 0.01, 0.4))
        apart = reduced_data(tests, now, velocity=velocity) if tests else NO_TESTS
        begun = 0.01 if now is ship else 0.4
        found = assess(now, record, options, tests=apart, stated=ship, progress=within(progress, begun, 0.7))
    progress("drawing the report", 0.7)
    command = _command(data, vessel, tests, velocity, options)
    content = EstimateContent(vessel=ship, found=found, command=command, version=__version__)
    files: dict[str, Content] = {
        "estimate.json": estimate_json(found, ship),
        "vessel-estimated.toml": estimated_vessel(found, ship, command=command),
        "estimate.html": partial(estimate_html, content, progress=within(progress, 0.7, 0.98)),
    }
    written = write_files(out or Path("runs") / data[0].stem, files)
    progress("done", 1.0)
    return Outcome(
        files=written,
        summary={**_estimate_summary(found), **note_on_roll(ship)},
        tables=_estimate_tables(found),
        notes=estimate_notes(content),
    )


def _command(data: Sequence[Path], vessel: Path, tests: Sequence[Path], velocity: str, options: EstimateOptions) -> str:
    """What to type for the same estimates."""
    stated = {"--vessel": vessel, "--test": tuple(tests), "--velocity": velocity, **_words(options)}
    return command_text("estimate", data, stated, usual={"--velocity": "auto", **_words(EstimateOptions())})


def _words(options: EstimateOptions) -> dict[str, object]:
    """Values by their names on the command line."""
    return {
        "--method": options.methods,
        "--fixed": options.fixed,
        "--mean": options.mean,
        "--blocks": options.blocks,
        "--start": options.start,
        "--motion": options.motion,
        "--horizon": options.horizon_s,
        "--constant": options.constant,
        "--steered": options.steered,
        "--samples": options.samples,
        "--offset": options.offset_mps,
        "--prior": options.prior,
    }


def _estimate_summary(found: Assessment) -> dict[str, object]:
    batches = found.record.batches
    return {
        "runs": len(batches),
        "samples": sum(len(batch) for batch in batches),
        "runs_kept_apart": len(found.tests.batches),
        "vessel_file_holds": found.best.method.name,
        **({"why": found.why} if found.why else {}),
        "parameters_of": found.motion,
        "what_limits_the_fit": limit_entries(found),
        "methods_left_out": list(found.left_out),
        "methods": {
            item.method.name: {
                "parameters": parameter_entries(item),
                "horizon_s": item.horizon_s,
                "predictions": prediction_entries(found, item),
                "fit": fit_entries(item),
                "samples_used": item.estimate.residuals.rows,
                "samples_used_by_equation": rows_entry(item),
                "steered": steered_entry(item),
                "warnings": len(estimate_warnings(found, item)),
            }
            for item in found.methods
        },
    }


def _estimate_tables(found: Assessment) -> tuple[TextTable, ...]:
    tables = [
        *([(prediction_title(found), prediction_table(found))] if found.compared else []),
        ("Estimates, with standard deviations", parameter_table(found)),
        ("Fit of the simulated output to the measured one, in per cent", fit_table(found)),
        (f"Causes of misfit of {found.best.method.name}", limit_table(found)),
    ]
    if found.left_out:
        tables.insert(0, ("Methods without an estimate", (("method", "why"), failure_rows(found))))
    disturbances = disturbance_table(found)
    if disturbances[1]:
        tables.append(("Current and wind, with standard deviations", disturbances))
    steered = any(batch.steered is not None for batch in found.record.batches)
    residuals = [item.estimate.residuals for item in found.methods]
    if steered or any((own.rows_of < own.rows).any() for own in residuals):
        tables.append(("Samples used", _used_samples(found)))
    return tuple(TextTable(title=title, header=header, rows=tuple(rows)) for title, (header, rows) in tables)


def _used_samples(found: Assessment) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: samples used by each method and equation, those marked as steered, what became of these."""
    rows: list[tuple[str, ...]] = [
        (
            item.method.name,
            str(item.estimate.residuals.rows),
            ", ".join(f"d{name}/dt {count}" for name, count in rows_entry(item).items()),
            str(steered.samples),
            STEERED_WORDS[steered.treatment] if steered.samples else "",
        )
        for item in found.methods
        for steered in (item.estimate.steered,)
    ]
    return ("method", "samples used", "by equation", "marked as steered", "treatment of these"), rows
