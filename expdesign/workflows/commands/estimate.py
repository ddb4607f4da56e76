"""`expdesign estimate`: parameters of a vessel from measured data."""

from __future__ import annotations

from expdesign import requests
from expdesign.assessment import NO_TESTS, EstimateOptions, assess, settled, uses_measured_wind, with_unstated
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.methods import methods_for
from expdesign.export.estimate_page import estimate_document
from expdesign.export.files import estimate_json, estimated_vessel
from expdesign.export.folder import Content
from expdesign.progress import Progress, silent, within
from expdesign.requests import repeating
from expdesign.workflows.outcome import Outcome, finished, results_folder, workers, workflow
from expdesign.workflows.steps.measured import data_files, doubted, equipped, measured, reduced_data


@workflow
def estimate(request: requests.Estimate, *, progress: Progress = silent) -> Outcome:
    """Parameters of a vessel from measured data, into `out` or runs/<first data file>."""
    used = data_files(request.data)
    for path in data_files(request.tests):
        if path in used:
            raise InputError(f"{path} is given for estimation and for testing, expected only one of them")
    folder = results_folder(request, request.data[0].stem)
    progress("reading the data", 0.0)
    ship, told = equipped(request.vessel, [*request.data, *request.tests])
    raw = measured(request.data, ship, velocity=request.velocity, told=told)
    methods = request.methods
    if request.unknown is not None:
        methods = methods_for(methods, request.unknown, wind=uses_measured_wind(ship, raw))
    options = EstimateOptions(
        methods=methods,
        fixed=request.fixed,
        mean=request.mean,
        blocks=request.blocks,
        start=request.start,
        motion=request.motion,
        horizon_s=request.horizon_s,
        constant=request.constant,
        steered=request.steered,
        samples=request.samples,
        offset_mps=request.offset_mps,
        prior=request.prior,
    )
    with workers(0, load=None), doubted(raw):
        smoothed = request.velocity == "smoothed"
        now, record = settled(ship, raw, options, smoothed=smoothed, progress=within(progress, 0.01, 0.4))
        apart = reduced_data(request.tests, now, velocity=request.velocity) if request.tests else NO_TESTS
        begun = 0.01 if now is ship else 0.4
        try:
            found = assess(now, record, options, tests=apart, stated=ship, progress=within(progress, begun, 0.65))
        except NotInformative as error:
            how = " (--fixed keeps parameters at the values of the vessel file)" if error.parameters else ""
            raise NotInformative(f"{error}{how}", parameters=error.parameters) from None
        progress("looking for what is not stated", 0.65)
        found = with_unstated(now, raw, options, found, smoothed=smoothed)
    progress("drawing the report", 0.7)
    files: dict[str, Content] = {
        "estimate.json": estimate_json(found, ship),
        "vessel-estimated.toml": estimated_vessel(found, ship, command=repeating(request)),
    }
    return finished(
        request,
        folder,
        files,
        estimate_document(found, ship),
        progress,
        page="estimate.html",
        drawing=within(progress, 0.7, 0.98),
    )
