"""`expdesign mine`: the most informative recorded batches, or a design from labelled ones."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from expdesign import __version__, requests
from expdesign.durations import Subset, best_subset
from expdesign.errors import InputError, NotInformative
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import record_csv
from expdesign.information import estimated_parameters
from expdesign.information.recorded import BatchInformation, recorded_information
from expdesign.kinematics import in_doubt
from expdesign.progress import Progress, silent, within
from expdesign.reduction import at_reference_point
from expdesign.requests import repeating
from expdesign.signals import Batch, Record
from expdesign.vessel import Vessel, VesselModel
from expdesign.workflows.outcome import Outcome, finished, results_folder, workflow
from expdesign.workflows.steps.labelled import labelled_design, labelled_document, labelled_files, piece_of
from expdesign.workflows.steps.measured import data_files, doubted, equipped, measured, reduced_data


@workflow
def mine(request: requests.Mine, *, progress: Progress = silent) -> Outcome:
    """The `keep` batches with the most information together, into `out` or runs/<first data file>.

    With labels, the data are cut into pieces of one label each; time is shared out among the labels, and draws of that
    design are compared with random subsets of as many pieces.

    Raises:
        InputError: arguments or files that are wrong.
        NoAnswer: the data do not inform about every parameter, or the nominal model is unstable.
    """
    folder = results_folder(request, request.data[0].stem)
    progress("reading the data", 0.02)
    (ship, told), paths = equipped(request.vessel, request.data), data_files(request.data)
    if request.labels is not None:
        if request.piece_s is None:
            raise InputError("--labels needs --piece, the length of a piece in seconds")
        if request.mean == "batch":
            raise InputError("--mean is batch, expected complete or none with --labels")
        record = reduced_data(paths, ship, velocity=request.velocity, told=told)
        with doubted(record):
            return _designed(request, folder, request.piece_s, record, paths, ship.model, within(progress, 0.1, 1.0))
    record = in_pieces(measured(paths, ship, velocity=request.velocity, told=told), request.piece_s)
    with doubted(record):
        return _mined(request, folder, record, ship, progress)


def _mined(request: requests.Mine, folder: Path, record: Record, ship: Vessel, progress: Progress) -> Outcome:
    """A choice of batches, written."""
    windy = all(batch.wind is not None for batch in record.batches)
    names, unseen = _parameters(ship.model, request.fixed, windy=windy)
    progress("simulating the runs", 0.2)
    seen = at_reference_point(record, ship.sensors, smoothed=request.velocity == "smoothed")
    batches = recorded_information(seen, ship.model, names, predictor="basic-wind" if windy else "basic")
    progress("choosing among them", 0.6)
    subset, doubted_of = _best_sound(batches, names, in_doubt(record), request)
    chosen = [batch for batch in record.batches if batch.name in subset.chosen]
    notes = (*([LEFT_OUT.format(", ".join(doubted_of))] if doubted_of else []), *record.notes)
    content = {
        **_content(subset, batches, names, unseen, mean=request.mean, command=repeating(request)),
        "in_doubt": {name: list(texts) for name, texts in doubted_of.items()},
        "notes": list(notes),
    }
    files = {
        "mining.json": json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        "chosen.csv": record_csv(chosen),
    }
    document = _document(content, _table(subset, batches), notes)
    return finished(request, folder, files, document, progress)


LEFT_OUT = (
    "Left out of the choice, because instruments of the file disagree as those of the others do not: {}. What a fault "
    "adds to a motion counts as information."
)


def _best_sound(
    batches: Sequence[BatchInformation],
    names: Sequence[str],
    doubts: Mapping[str, tuple[str, ...]],
    request: requests.Mine,
) -> tuple[Subset, Mapping[str, tuple[str, ...]]]:
    """The best of batches that are in no doubt, and those that are; the best of all where too few are left."""
    sound = [batch for batch in batches if batch.name not in doubts]
    if doubts and len(sound) >= request.keep:
        try:
            return best_subset(sound, names, size=request.keep, mean_subtraction=request.mean), doubts
        except NotInformative:
            pass  # only with the others do they inform about every parameter
    return best_subset(batches, names, size=request.keep, mean_subtraction=request.mean), {}


SYMMETRIC = "symmetric part of the information"
MAGNITUDE = "magnitude of the determinant: with this nominal model the symmetric part is not definite"
MAY_FALL = (
    "The information of more batches may be less, and that of some more than 100 %: it is the magnitude of a "
    "determinant."
)


def _designed(
    request: requests.Mine,
    folder: Path,
    piece_s: float,
    record: Record,
    paths: Sequence[Path],
    model: VesselModel,
    progress: Progress,
) -> Outcome:
    """A design from labelled data, written."""
    windy = all(batch.wind is not None for batch in record.batches)
    names, _ = _parameters(model, request.fixed, windy=windy)
    found = labelled_design(
        record,
        paths,
        model,
        parameters=names,
        predictor="basic-wind" if windy else "basic",
        asked=request,
        piece_s=piece_s,
        progress=progress,
    )
    files = labelled_files(found, names, model.outputs, repeating(request))
    document = replace(labelled_document(found, model.outputs), notes=record.notes)
    return finished(request, folder, files, document, progress)


def in_pieces(record: Record, piece_s: float | None) -> Record:
    """Batches cut into equal pieces of about `piece_s` [s]; None leaves them whole.

    Raises:
        InputError: a piece of fewer than three samples.
    """
    if piece_s is None:
        return record
    step = record.batches[0].sample_time_s
    if not piece_s >= 3 * step:
        raise InputError(f"--piece is {piece_s:g}, expected three samples of {step:g} s or more")
    return replace(record, batches=tuple(piece for batch in record.batches for piece in _pieces(batch, piece_s)))


def _pieces(batch: Batch, piece_s: float) -> list[Batch]:
    count = max(1, round(len(batch) * batch.sample_time_s / piece_s))
    if count == 1:
        return [batch]
    edges = np.linspace(0, len(batch), count + 1).round().astype(int)
    spans = [slice(int(first), int(last)) for first, last in pairwise(edges)]
    return [piece_of(batch, span) for span in spans]


def _parameters(model: VesselModel, fixed: Sequence[str], *, windy: bool) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Parameters to estimate, and those that data without measured wind cannot determine."""
    wanted = estimated_parameters(model, fixed)
    of_air = {
        term.name
        for term, expression in zip(model.terms, model.expressions, strict=True)
        if {"u_q", "v_q"} & set(expression.signals)
    }
    unseen = () if windy else tuple(name for name in wanted if name in of_air)
    names = tuple(name for name in wanted if name not in unseen)
    if not names:
        raise InputError("every parameter is fixed or needs measured wind, nothing is left to estimate")
    return names, unseen


def _content(
    subset: Subset,
    batches: Sequence[BatchInformation],
    names: Sequence[str],
    unseen: Sequence[str],
    *,
    mean: str,
    command: str,
) -> dict[str, object]:
    """`mining.json`."""
    of = {batch.name: batch for batch in batches}
    return {
        "parameters": list(names),
        "not_told_without_wind": list(unseen),
        "mean_subtraction": mean,
        "keep": len(subset.chosen),
        "chosen": list(subset.chosen),
        "efficiency": subset.efficiency,
        "efficiency_bound": subset.bound if np.isfinite(subset.bound) else None,
        "all_subsets_tried": subset.exact,
        "counts": SYMMETRIC if subset.symmetric else MAGNITUDE,
        "batches": [
            {
                "rank": rank,
                "name": name,
                "duration_s": of[name].seconds,
                "samples": of[name].samples,
                "chosen": name in subset.chosen,
                "efficiency_up_to_here": float(efficiency),
            }
            for rank, (name, efficiency) in enumerate(zip(subset.names, subset.first, strict=True), start=1)
        ],
        "command": command,
        "version": __version__,
    }


def _document(content: Mapping[str, object], table: Table, notes: Sequence[str]) -> Document:
    shown = ("efficiency", "efficiency_bound", "all_subsets_tried", "counts", "not_told_without_wind")
    # without a symmetric part that is definite, more data may hold less
    doubt = () if content["counts"] == SYMMETRIC else (MAY_FALL,)
    facts = {name: content[name] for name in shown if content[name] != []}
    return Document(facts=facts, values={"chosen": content["chosen"]}, sections=tabled(table), notes=(*doubt, *notes))


def _table(subset: Subset, batches: Sequence[BatchInformation]) -> Table:
    of = {batch.name: batch for batch in batches}
    rows = zip(subset.names, subset.first, strict=True)
    return Table(
        title="Batches in the order in which each adds most, with the cumulative information",
        header=("rank", "batch", "seconds", "information", "chosen"),
        rows=tuple(
            (
                str(rank),
                name,
                f"{of[name].seconds:.1f}",
                f"{100 * efficiency:.1f} %" if efficiency > 0 else "not yet enough",
                "yes" if name in subset.chosen else "",
            )
            for rank, (name, efficiency) in enumerate(rows, start=1)
        ),
    )
