"""A design from recorded data whose pieces are labelled: shares of the labels, and how draws of it simulate."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from expdesign import requests
from expdesign.durations import (
    Constraints,
    DurationDesign,
    build_recorded,
    pool_gains,
    require_told_apart,
    solve_durations,
)
from expdesign.errors import InputError, NotInformative
from expdesign.estimation.methods import estimate
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import durations_json, finite, record_csv, recorded_dictionary_json, subsets_json
from expdesign.information.recorded import BatchInformation, by_label, recorded_information
from expdesign.progress import Progress, silent, within
from expdesign.records import row_labels
from expdesign.rehearsal import Drawn, drawn_subsets, random_subsets, recorded_pieces, try_subsets
from expdesign.signals import Batch, Record
from expdesign.vessel import VesselModel

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
    most = {name: number * piece_s for name, number in count.items() if number < asked.keep}
    problem = build_recorded(
        dictionary,
        parameters,
        run_s=np.full(len(dictionary), piece_s),
        total_s=asked.keep * piece_s,
        mean_subtraction=asked.mean,
        constraints=Constraints(most_s=most),
    )
    if np.isnan(pool_gains(problem.matrices)).all():
        raise NotInformative(
            "the labelled pieces together do not inform about every parameter; hold known ones with --fixed",
            parameters=tuple(parameters),
        )
    require_told_apart(problem, np.array([float(item.samples) for item in dictionary]))
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
