"""`expdesign indices`: manoeuvring indices of a vessel, from its model and from measured runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from expdesign import requests
from expdesign.errors import InputError, NoAnswer
from expdesign.export.indices_form import IndicesContent, indices_json
from expdesign.export.indices_page import indices_document
from expdesign.indices import StandardResults, measured_trial, standard_results, with_drift_of_circles
from expdesign.indices.measured import Found
from expdesign.particulars import Expected, expected, standard_trials
from expdesign.progress import Progress, silent
from expdesign.reduction import at_reference_point
from expdesign.vessel import Vessel
from expdesign.workflows.outcome import Outcome, finished, results_folder, workflow
from expdesign.workflows.steps.measured import data_files, equipped, measured


@workflow
def indices(request: requests.Indices, *, progress: Progress = silent) -> Outcome:
    """Turning, zig-zag and stopping indices with the limits of MSC.137(76), into `out` or runs/<vessel>-indices.

    Depth of the water, mean true wind and sea state are those of the measured trials, for the form.
    """
    folder = results_folder(request, f"{request.vessel.stem}-indices")
    progress("reading the vessel", 0.0)
    ship, told = equipped(request.vessel, request.data)
    _check_place(ship, request.antenna_forward_m)
    seen, notes = _measured(request.data, ship, request.antenna_forward_m, progress)
    progress("simulating the model's standard trials", 0.6)
    found, why_not = _simulated(ship, request.speed_mps, needed=not request.data)
    content = IndicesContent(
        vessel=ship,
        scale=request.scale,
        simulated=found,
        simulated_why_not=why_not,
        expected=_expected(ship, found),
        measured=seen,
        notes=(*told, *notes),
        depth_m=request.depth_m,
        wind_mps=request.wind_mps,
        sea_state=request.sea_state,
    )
    return finished(
        request,
        folder,
        {"indices.json": indices_json(content)},
        indices_document(content),
        progress,
        page="indices.html",
    )


def _check_place(ship: Vessel, forward_m: float) -> None:
    stated = [ahead for ahead in (ship.sensors.position_forward_m, ship.sensors.velocity_forward_m) if ahead]
    if forward_m and stated:
        raise InputError(
            f"--antenna-forward-m is {forward_m:g}, expected none where the vessel file states a sensor's place, "
            f"{stated[0]:g} m"
        )


def _measured(
    data: Sequence[Path], ship: Vessel, forward_m: float, progress: Progress
) -> tuple[tuple[Found, ...], tuple[str, ...]]:
    """Each file by itself: trials need not share a sample time."""
    seen: list[Found] = []
    doubts: list[str] = []
    notes: list[str] = []
    files = data_files(data)
    for number, path in enumerate(files):
        progress(f"reading {path.name}", 0.6 * number / len(files))
        record = at_reference_point(measured([path], ship), ship.sensors)
        seen += [measured_trial(ship, batch, reference_forward_m=forward_m) for batch in record.batches]
        doubts += record.doubts
        notes += (note for note in record.notes if note not in (*record.doubts, *record.idle))
    return with_drift_of_circles(seen), (*doubts, *notes)


def _simulated(ship: Vessel, speed_mps: float | None, *, needed: bool) -> tuple[StandardResults | None, str]:
    """The model's trials; where measured ones are at hand, why there are none."""
    try:
        return standard_results(ship, speed_mps=speed_mps), ""
    except InputError as error:
        if needed:
            raise
        return None, str(error)


def _expected(ship: Vessel, found: StandardResults | None) -> tuple[Expected, ...]:
    """What ships do that the vessel file's standard deviations allow, where it states some."""
    if found is None or not found.circles or not ship.model.parameter_std.any():
        return ()
    try:
        return expected(ship, standard_trials(found.speed_mps, stops=bool(found.stops)))
    except (InputError, NoAnswer):  # hardly any such ship is within its ranges
        return ()
