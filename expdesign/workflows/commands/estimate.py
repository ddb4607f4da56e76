"""`expdesign estimate`: parameters of a vessel from measured data."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from expdesign import __version__, requests
from expdesign.assessment import NO_TESTS, EstimateOptions, assess, settled
from expdesign.errors import InputError
from expdesign.export import Content, estimate_json, estimated_vessel, write_files
from expdesign.export.estimate_page import EstimateContent, estimate_document
from expdesign.export.pages import document_html
from expdesign.progress import Progress, silent, within
from expdesign.requests import command_text
from expdesign.workflows.outcome import Outcome
from expdesign.workflows.steps.measured import data_files, doubted, equipped, measured, reduced_data
from expdesign.workflows.steps.workers import workers


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
    command = command_text(requests.Estimate(
        data=tuple(data), vessel=vessel, methods=options.methods, fixed=options.fixed, tests=tuple(tests),
        velocity=velocity, mean=mean, blocks=blocks, start=start, motion=motion, horizon_s=horizon_s,
        constant=constant, steered=steered, samples=samples, offset_mps=offset_mps, prior=prior,
    ))  # fmt: skip
    content = EstimateContent(vessel=ship, found=found, command=command, version=__version__)
    document = estimate_document(content)
    files: dict[str, Content] = {
        "estimate.json": estimate_json(found, ship),
        "vessel-estimated.toml": estimated_vessel(found, ship, command=command),
        "estimate.html": partial(document_html, document, progress=within(progress, 0.7, 0.98)),
    }
    written = write_files(out or Path("runs") / data[0].stem, files)
    progress("done", 1.0)
    return Outcome(files=written, document=document)
