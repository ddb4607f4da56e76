"""Designs from recorded data put to the test: subsets of pieces are estimated from, and simulated on the others.

Instruments come from one model, so every piece i enters an estimate by sums over its rows alone, and the estimate from
any subset is one small linear solve:

    theta = (sum_i H_i - Z F^T / N)^-1 (sum_i h_i - Z y / N)
    Z = sum_i Z_i,   F = sum_i F_i,   y = sum_i y_i,   N = sum_i N_i

with H_i = sum Z Phi^T, h_i = sum Z y, and the sums Z_i of instruments, F_i of regressors, y_i of what they explain. The
second terms stand for complete mean subtraction; without it they are left out.

Source: F. Ljungberg, doctoral thesis, Linköping University, (2.21), (4.40), 9.2.3, 9.3.1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from expdesign.conventions import OUTPUTS
from expdesign.errors import Diverged, InputError
from expdesign.estimation.regression import build_layout, build_regression, model_for
from expdesign.estimation.replay import InstrumentModel, Integration, apart_from_start, build_replay, instrument_wind
from expdesign.progress import Progress, silent
from expdesign.signals import Record
from expdesign.values import Array, seal, sealed
from expdesign.vessel import VesselModel

SINGULAR = 1e-12  # least singular value of scaled equations, as a share of the largest, that still gives an estimate
DEGENERATE_SHARE = 1.0  # simulation errors above this share of the motion make a model degenerate
Subset = tuple[int, ...]
"""Numbers of the chosen pieces, ascending."""
Simulate = Callable[[Array], Array]
"""Parameters (p,) -> (m, n) mean square simulation error of every piece; raises Diverged."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pieces:
    """Recorded pieces as sums, and how models are simulated on them."""

    labels: tuple[str, ...]  # of each piece
    H: Array  # (m, p, p) sums of Z Phi^T
    h: Array  # (m, p) sums of Z y
    # Z, F: (m, p, n) sums of instruments and of regressors
    Z: Array
    F: Array
    y: Array  # (m, n) sums of what is explained
    rows: Array  # (m,) number of rows
    motion: Array  # (m, n) mean square of the measured motion
    mean: str  # "none", or "complete" for means taken off over all data of a subset
    simulate: Simulate  # errors of a model

    def __post_init__(self) -> None:
        seal(self, H="m p p", h="m p", Z="m p n", F="m p n", y="m n", rows="m", motion="m n")
        if self.mean not in MEANS:
            raise InputError(f"the mean subtraction is {self.mean!r}, expected one of {', '.join(MEANS)}")

    def estimate(self, subset: Sequence[int]) -> Array | None:
        """(p,) estimate from some pieces; None where they do not inform about every parameter."""
        chosen = list(subset)
        H, h = self.H[chosen].sum(axis=0), self.h[chosen].sum(axis=0)
        if self.mean == "complete":
            Z, count = self.Z[chosen].sum(axis=0), self.rows[chosen].sum()
            H = H - Z @ self.F[chosen].sum(axis=0).T / count
            h = h - Z @ self.y[chosen].sum(axis=0) / count
        left, right = (np.sqrt(np.abs(H).max(axis=axis)) for axis in (1, 0))
        if not (left.all() and right.all()):
            return None
        scaled = H / np.outer(left, right)
        values = np.linalg.svd(scaled, compute_uv=False)
        if not values[-1] > SINGULAR * values[0]:
            return None
        return np.asarray(np.linalg.solve(scaled, h / left) / right)


MEANS = ("none", "complete")


def recorded_pieces(
    record: Record,
    labels: Sequence[str],
    model: VesselModel,
    *,
    parameters: Sequence[str],
    predictor: str = "basic",
    mean: str = "complete",
) -> Pieces:
    """Pieces of a record, each a batch of it, with instruments simulated by a model.

    Args:
        record: a batch for every piece, with the inputs that actuators deliver.
        labels: of each piece.
        model: nominal; a model in continuous form is simulated by Runge-Kutta and its regressors are averaged over
            each sample interval, one in discrete form by Euler's map.
        parameters: names to estimate; all others are held.
        predictor: "basic" or "basic-wind".
        mean: "none" or "complete".

    Raises:
        InputError: as `estimation.methods.estimate`.
        NotInformative: pieces of fewer than three samples.
        Diverged: the nominal model is unstable.
    """
    driven = model_for(model, record)
    continuous = driven.form == "continuous"
    fixed = tuple(name for name in driven.names if name not in parameters)
    quadrature = "trapezoid" if continuous else "euler"
    layout = build_layout(driven, record, predictor=predictor, fixed=fixed, quadrature=quadrature)
    rows = apart_from_start(build_regression(layout, record))
    replay = build_replay(
        driven, record, Integration("rk4", 1) if continuous else Integration(), windy=layout.predictor.wind
    )
    instruments = InstrumentModel(layout, record, rows, replay).instruments(driven.parameters)
    parts = [rows.regression.batch_of == number for number in range(len(record.batches))]
    Phi, y = rows.regression.Phi, rows.regression.y
    own = [(instruments[part], Phi[part], y[part]) for part in parts]
    columns = [OUTPUTS.index(name) for name in driven.outputs]
    winds = [instrument_wind(batch, "lagged").T if layout.predictor.wind else None for batch in record.batches]

    def simulate(values: Array) -> Array:
        full = layout.full_parameters(values)
        errors = []
        for batch, wind in zip(record.batches, winds, strict=True):
            velocity = replay.states(batch, full, wind)[:, 3:]
            errors.append(np.nanmean((velocity - batch.velocity)[:, columns] ** 2, axis=0))
        return np.array(errors)

    return Pieces(
        labels=tuple(labels),
        H=np.array([np.einsum("knp,knq->pq", Z, F) for Z, F, _ in own]),
        h=np.array([np.einsum("knp,kn->p", Z, e) for Z, _, e in own]),
        Z=np.array([Z.sum(axis=0).T for Z, _, _ in own]),
        F=np.array([F.sum(axis=0).T for _, F, _ in own]),
        y=np.array([e.sum(axis=0) for _, _, e in own]),
        rows=np.array([float(len(e)) for _, _, e in own]),
        motion=np.array([np.nanmean(batch.velocity[:, columns] ** 2, axis=0) for batch in record.batches]),
        mean=mean,
        simulate=simulate,
    )


@sealed(rmse="d n", degenerate="d")
class Drawn:
    """A design, drawn many times from the pieces."""

    design: str  # its name
    subsets: tuple[Subset, ...]  # pieces of each draw
    # (d, n) root mean square simulation error of each draw on the pieces that it does not use, every label counting
    # alike; inf where the model diverges, nan where there is no estimate
    rmse: Array
    # (d,) 1 where there is no estimate, the model diverges, or its error in some output is larger than the motion
    # itself; else 0
    degenerate: Array

    @property
    def norm(self) -> Array:
        """(d,) norm of the errors over the outputs; inf without an estimate."""
        norm = np.sqrt((self.rmse**2).sum(axis=1))
        return np.where(np.isnan(norm), np.inf, norm)


def drawn_subsets(
    labels: Sequence[str], runs: Mapping[str, int], *, draws: int, rng: np.random.Generator
) -> tuple[Subset, ...]:
    """Draws of a design: so many pieces of every label, without repetition.

    Raises:
        InputError: more pieces of a label than there are.
    """
    places = {label: np.flatnonzero([name == label for name in labels]) for label in runs}
    for label, count in runs.items():
        if count > len(places[label]):
            raise InputError(f"the design has {count} pieces of {label!r}, recorded are {len(places[label])}")
    return tuple(
        _rising(np.concatenate([rng.choice(places[label], count, replace=False) for label, count in runs.items()]))
        for _ in range(draws)
    )


def random_subsets(labels: Sequence[str], size: int, *, draws: int, rng: np.random.Generator) -> tuple[Subset, ...]:
    """Draws of `size` pieces without repetition, every label that has pieces left being equally likely each time.

    Raises:
        InputError: more pieces than there are.
    """
    if size > len(labels):
        raise InputError(f"{size} of {len(labels)} pieces cannot be drawn, expected 1 to {len(labels)}")
    return tuple(_rising(np.array(list(_one_by_one(labels, size, rng)))) for _ in range(draws))


def _one_by_one(labels: Sequence[str], size: int, rng: np.random.Generator) -> Iterator[int]:
    left = {label: [place for place, name in enumerate(labels) if name == label] for label in dict.fromkeys(labels)}
    for _ in range(size):
        label = list(left)[int(rng.integers(len(left)))]
        yield left[label].pop(int(rng.integers(len(left[label]))))
        if not left[label]:
            del left[label]


def _rising(places: NDArray[np.intp]) -> Subset:
    return tuple(sorted(int(place) for place in places))


def try_subsets(pieces: Pieces, design: str, subsets: Sequence[Subset], *, progress: Progress = silent) -> Drawn:
    """Estimate from every subset, and simulate the estimate on the pieces that the subset leaves."""
    known: dict[Subset, tuple[Array, float]] = {}
    for number, subset in enumerate(subsets):
        progress(f"simulating {design} subsets", number / len(subsets))
        if subset not in known:
            known[subset] = _tried(pieces, subset)
    return Drawn(
        design=design,
        subsets=tuple(subsets),
        rmse=np.array([known[subset][0] for subset in subsets]),
        degenerate=np.array([known[subset][1] for subset in subsets]),
    )


def _tried(pieces: Pieces, subset: Subset) -> tuple[Array, float]:
    """(n,) errors, and 1.0 if the model is degenerate."""
    outputs = pieces.motion.shape[1]
    values = pieces.estimate(subset)
    if values is None:
        return np.full(outputs, np.nan), 1.0
    try:
        errors = pieces.simulate(values)
    except Diverged:
        return np.full(outputs, np.inf), 1.0
    weights = _weights(pieces.labels, subset)
    mean, motion = weights @ errors, weights @ pieces.motion
    return np.sqrt(mean), float((mean > DEGENERATE_SHARE**2 * motion).any())


def _weights(labels: Sequence[str], used: Subset) -> Array:
    """(m,) weights of the pieces not used, of all where none is left: they add up to one, every label alike."""
    free = np.array([place not in used for place in range(len(labels))])
    if not free.any():
        free[:] = True
    weights = np.zeros(len(labels))
    for label in set(labels):
        own = free & np.array([name == label for name in labels])
        weights[own] = 1.0 / max(own.sum(), 1)
    return np.asarray(weights / weights.sum())
