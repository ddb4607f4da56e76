"""`expdesign mine`: the most informative recorded batches, or a design from labelled ones."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from expdesign import __version__, requests
from expdesign.durations import (
    Constraints,
    DurationDesign,
    Subset,
    best_subset,
    build_recorded,
    pool_gains,
    solve_durations,
)
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.methods import estimate
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import durations_json, finite, record_csv, recorded_dictionary_json, subsets_json
from expdesign.information import estimated_parameters
from expdesign.information.recorded import BatchInformation, by_label, recorded_information
from expdesign.kinematics import in_doubt
from expdesign.progress import Progress, silent, within
from expdesign.records import row_labels
from expdesign.reduction import at_reference_point
from expdesign.rehearsal import Drawn, drawn_subsets, random_subsets, recorded_pieces, try_subsets
from expdesign.requests import repeating
from expdesign.signals import Batch, Record
from expdesign.vessel import Vessel, VesselModel
from expdesign.workflows.outcome import Outcome, finished, workflow
from expdesign.workflows.steps.measured import data_files, doubted, equipped, measured, reduced_data

OPTIMISED, RANDOM = "optimised", "random"


@dataclass(frozen=True, kw_only=True, eq=False)
class Labelled:
    """A design from labelled data, and how its draws and random subsets simulate."""

    record: Record  # a batch for every piece
    labels: tuple[str, ...]  # of each piece
    dictionary: tuple[BatchInformation, ...]  # moments of each label
    gains: tuple[float, ...]  # (q,) of each label beside the pool of all
    design: DurationDesign  # shares and pieces of every label
    drawn: tuple[Drawn, ...]  # optimised and random subsets


def labelled_design(
    record: Record,
    paths: Sequence[Path],
    model: VesselModel,
    *,
    parameters: Sequence[str],
    predictor: str,
    asked: requests.Mine,
    piece_s: float,
    progress: Progress = silent,
) -> Labelled:
    """Shares by the information of each label, and simulation errors of subsets; see `rehearsal.recorded`.

    Args:
        record: with delivered inputs.
        paths: the files it was read from.
        model: nominal; where all its parameters are zero, the least-squares estimate from all pieces stands for it.
        parameters: names to estimate.
        predictor: "basic" or "basic-wind".
        asked: keep, draws, labels, mean and seed count.
        piece_s: length of a piece [s].

    Raises:
        InputError: labels, lengths or numbers that are wrong.
        NotInformative: the labels together do not inform about every parameter.
    """
    pieces, labels = labelled_pieces(record, row_labels(record, paths, asked.labels or ""), piece_s)
    nominal = _nominal(pieces, model, parameters, predictor)
    progress("simulating the pieces", 0.0)
    batches = recorded_information(pieces, nominal, parameters, predictor=predictor, delivered=True)
    dictionary = by_label(batches, labels)
    design = _design_of(dictionary, labels, parameters, asked, piece_s)
    progress("comparing subsets", 0.1)
    sums = recorded_pieces(pieces, labels, nominal, parameters=parameters, predictor=predictor, mean=asked.mean)
    rng = np.random.default_rng(asked.seed)
    runs = dict(zip(design.problem.names, design.repeats, strict=True))
    subsets = {
        OPTIMISED: drawn_subsets(labels, runs, draws=asked.draws, rng=rng),
        RANDOM: random_subsets(labels, sum(design.repeats), draws=asked.draws, rng=rng),
    }
    drawn = tuple(
        try_subsets(sums, name, items, progress=within(progress, 0.1 + 0.45 * number, 0.55 + 0.45 * number))
        for number, (name, items) in enumerate(subsets.items())
    )
    gains = pool_gains(design.problem.matrices)
    return Labelled(
        record=pieces, labels=labels, dictionary=dictionary, gains=tuple(gains.tolist()), design=design, drawn=drawn
    )


def _nominal(pieces: Record, model: VesselModel, parameters: Sequence[str], predictor: str) -> VesselModel:
    if model.parameters.any():
        return model
    from expdesign.estimation.instrumental import Settings
    from expdesign.estimation.methods import METHODS

    (method,) = (item.name for item in METHODS if item.weather.name == predictor and item.solver == "ls")
    fixed = tuple(name for name in model.names if name not in parameters)
    quadrature = "trapezoid" if model.form == "continuous" else "euler"
    return estimate(pieces, model, method=method, settings=Settings(fixed=fixed, quadrature=quadrature)).model(model)


def _design_of(
    dictionary: Sequence[BatchInformation],
    labels: Sequence[str],
    parameters: Sequence[str],
    asked: requests.Mine,
    piece_s: float,
) -> DurationDesign:
    count = {item.name: labels.count(item.name) for item in dictionary}
    if asked.keep > len(labels):
        raise InputError(f"--keep is {asked.keep}, expected at most the {len(labels)} labelled pieces")
    matrices = np.array([item.bordered(asked.mean) for item in dictionary])
    if np.isnan(pool_gains(matrices)).all():
        raise NotInformative(
            "the labelled pieces together do not inform about every parameter; hold known ones with --fixed",
            parameters=tuple(parameters),
        )
    most = {name: number * piece_s for name, number in count.items() if number < asked.keep}
    problem = build_recorded(
        dictionary,
        parameters,
        run_s=np.full(len(dictionary), piece_s),
        total_s=asked.keep * piece_s,
        mean_subtraction=asked.mean,
        constraints=Constraints(most_s=most),
    )
    return solve_durations(problem)


def labelled_pieces(record: Record, labels: Sequence[Sequence[str]], piece_s: float) -> tuple[Record, tuple[str, ...]]:
    """Pieces of equal length within which the label does not change, each a batch, and their labels.

    What is left at the end of a stretch of one label, shorter than a piece, is not used.

    Raises:
        InputError: a piece of fewer than three samples, or none that is long enough.
    """
    step = record.batches[0].sample_time_s
    samples = round(piece_s / step) if np.isfinite(piece_s) else 0
    if samples < 3:
        raise InputError(f"--piece is {piece_s:g}, expected three samples of {step:g} s or more")
    found: list[tuple[Batch, str]] = []
    for batch, names in zip(record.batches, labels, strict=True):
        changes = [place for place in range(1, len(names)) if names[place] != names[place - 1]]
        edges = [0, *changes, len(names)]
        for begin, end in itertools.pairwise(edges):
            starts = range(begin, end - samples + 1, samples) if names[begin] else ()
            found += [(piece_of(batch, slice(start, start + samples)), names[begin]) for start in starts]
    if not found:
        raise InputError(f"--piece is {piece_s:g}: no stretch of one label is that long")
    batches, names = zip(*found, strict=True)
    return replace(record, batches=batches), names


def piece_of(batch: Batch, span: slice) -> Batch:
    """Some samples of a batch."""
    begin, end = (row * batch.sample_time_s for row in (span.start, span.stop))
    return replace(batch.cut(span), name=f"{batch.name}, {begin:g} to {end:g} s")


def labelled_files(found: Labelled, parameters: Sequence[str], outputs: Sequence[str], command: str) -> dict[str, str]:
    """dictionary.json, durations.json, subsets.json, and the pieces of the first optimised draw as chosen.csv."""
    names = tuple(batch.name for batch in found.record.batches)
    pieces = {item.name: found.labels.count(item.name) for item in found.dictionary}
    return {
        "dictionary.json": recorded_dictionary_json(
            found.dictionary,
            parameters,
            outputs=outputs,
            pieces=pieces,
            gains=found.gains,
            mean_subtraction=found.design.problem.mean_subtraction,
        ),
        "durations.json": durations_json(found.design),
        "subsets.json": subsets_json(found.drawn, outputs=outputs, pieces=names, labels=found.labels, command=command),
        "chosen.csv": record_csv([found.record.batches[place] for place in found.drawn[0].subsets[0]]),
    }


def labelled_document(found: Labelled, outputs: Sequence[str]) -> Document:
    """Labels with their shares, and simulation errors of the designs."""
    design = found.design
    order = np.argsort(-np.array(found.gains))
    shares = Table(
        title="Labels by what they add beside all others",
        header=("label", "pieces", "gain beside the pool", "share", "pieces of the design"),
        rows=tuple(
            (
                found.dictionary[q].name,
                str(found.labels.count(found.dictionary[q].name)),
                f"{found.gains[q]:.3g}",
                f"{100 * design.fractions[q]:.1f} %",
                str(design.repeats[q]),
            )
            for q in order
        ),
    )
    errors = Table(
        title="Simulation error on the pieces that a draw does not use, median (95 % of the draws below)",
        header=("design", "draws", *outputs, "norm", "degenerate models"),
        rows=tuple(
            (
                item.design,
                str(len(item.subsets)),
                *(_quantiles(np.where(np.isnan(column), np.inf, column)) for column in item.rmse.T),
                _quantiles(item.norm),
                share_with_error(item.degenerate),
            )
            for item in found.drawn
        ),
    )
    return Document(
        facts={
            "log_det": design.log_det,
            "log_det_guaranteed": finite(design.certificate.guaranteed),
            "efficiency_of_whole_pieces": design.efficiency_repeats,
        },
        values={
            "labels": {item.name: found.labels.count(item.name) for item in found.dictionary},
            "pieces_of_design": {name: n for name, n in zip(design.problem.names, design.repeats, strict=True) if n},
            "median_simulation_error": {item.design: finite(float(np.median(item.norm))) for item in found.drawn},
            "degenerate_models": {item.design: float(item.degenerate.mean()) for item in found.drawn},
        },
        sections=tabled(shares, errors),
    )


def _quantiles(values: np.ndarray) -> str:
    median, high = np.quantile(values, [0.5, 0.95], method="higher")
    return f"{median:.3g} ({high:.3g})".replace("inf", "diverges")


def share_with_error(values: np.ndarray) -> str:
    """A share in per cent with its standard error; half a draw of either kind is added, so that 0 has one."""
    smoothed = (values.sum() + 0.5) / (len(values) + 1)
    return f"{100 * values.mean():.1f} ± {100 * (smoothed * (1 - smoothed) / len(values)) ** 0.5:.1f} %"


@workflow
def mine(request: requests.Mine, *, progress: Progress = silent) -> Outcome:
    """The `keep` batches with the most information together, into `out` or runs/<first data file>.

    With labels, the data are cut into pieces of one label each; time is shared out among the labels, and draws of that
    design are compared with random subsets of as many pieces.

    Raises:
        InputError: arguments or files that are wrong.
        NoAnswer: the data do not inform about every parameter, or the nominal model is unstable.
    """
    progress("reading the data", 0.02)
    (ship, told), paths = equipped(request.vessel, request.data), data_files(request.data)
    if request.labels is not None:
        if request.piece_s is None:
            raise InputError("--labels needs --piece, the length of a piece in seconds")
        if request.mean == "batch":
            raise InputError("--mean is batch, expected complete or none with --labels")
        record = reduced_data(paths, ship, velocity=request.velocity, told=told)
        with doubted(record):
            return _designed(request, request.piece_s, record, paths, ship.model, within(progress, 0.1, 1.0))
    record = in_pieces(measured(paths, ship, velocity=request.velocity, told=told), request.piece_s)
    with doubted(record):
        return _mined(request, record, ship, progress)


def _mined(request: requests.Mine, record: Record, ship: Vessel, progress: Progress) -> Outcome:
    """A choice of batches, written."""
    windy = all(batch.wind is not None for batch in record.batches)
    names, unseen = _parameters(ship.model, request.fixed, windy=windy)
    progress("simulating the runs", 0.2)
    seen = at_reference_point(record, ship.sensors, smoothed=request.velocity == "smoothed")
    batches = recorded_information(seen, ship.model, names, predictor="basic-wind" if windy else "basic")
    _need_every_parameter(batches, names)
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
    return finished(request, Path("runs") / request.data[0].stem, files, document, progress)


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
    return finished(request, Path("runs") / request.data[0].stem, files, document, progress)


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


def _need_every_parameter(batches: Sequence[BatchInformation], names: Sequence[str]) -> None:
    """Refuse parameters whose regressor or instrument is always zero."""
    size = np.max([np.abs(np.diag(batch.X)) for batch in batches], axis=0)
    blind = tuple(name for name, value in zip(names, size, strict=True) if not value > 0)
    if blind:
        raise NotInformative(
            f"no batch has information about {', '.join(blind)}; hold known parameters with --fixed", parameters=blind
        )


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
