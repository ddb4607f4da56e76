"""Which estimate predicts best: errors of predictions from measured states, on runs that an estimate has not seen.

Runs are left out in turn, and every method estimates from the rest. They are left out whole: with half of a run in the
estimate, its other half asks for no motion that the estimate has not seen. Only a run that is most of the data is cut.
The model then predicts what was left out, over `AHEAD_S` at a time, from measured velocities: free first states
would hide a useless model, and one simulation of a whole run tells more of the ship's stability than of the model. An
error is over the standard deviation of the measured output; 1 is no better than a constant, and more counts as 1. Runs
and outputs are joined by geometric means, in which no single one decides. Errors that differ by less than `SAME_ERROR`
of themselves count as equal. Of such methods the one goes first that noise in the measured velocities does not bias:
instrumental variables, then output error, then least squares.

Few runs tell methods apart badly: what is left of them is half of the data or less, and they differ among themselves.
So output error over `AHEAD_S`, which makes the very error least that decides, goes first unless another one is
better for certain: by an interval of 95 % over the runs, or by a factor of `FAR_WORSE`. A run that a method
cannot do without costs it an error of 1, but is not in the interval: the loss would make the others look like chance.

Predictions of what was recorded do not show what a model does beyond it. A hull dissipates: driven no harder than in
the data, but with its rudders hard over, no point of it gets many times as fast as in the data. A model in which one
does goes last. So does an estimate that predicts even the data it is from worse than others like it predicted what they
had not seen: refinements may settle from parts of the data, and not from all of them.

Sources: M. Stone, Journal of the Royal Statistical Society B 36 (1974), 111-147, for leaving out; L. Breiman, J. H.
Friedman, R. A. Olshen and C. J. Stone, Classification and Regression Trees (1984), 3.4.3, for a preference among those
that left-out data do not tell apart.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.assessment.ahead import LARGEST_ERROR, Ahead, by_run, missed, typical
from expdesign.assessment.misfit import AHEAD_S
from expdesign.conventions import rotated
from expdesign.errors import Diverged, InputError, NoAnswer
from expdesign.estimation.methods import Method
from expdesign.estimation.regression import model_for
from expdesign.estimation.replay import Integration, build_replay
from expdesign.signals import Batch, Record
from expdesign.values import Array, sealed
from expdesign.vessel import Limit, Missed, Vessel, VesselModel

SAME_ERROR = 0.02  # share of an error below which a difference of two does not count
FAR_WORSE = 2.0  # times the least error, from which on one is worse for certain however few runs there are
MOST_FOLDS = 4  # into which runs are divided, to be left out in turn
MOST_OF_DATA = 2 / 3  # share of the data from which on a run is not left out whole
HELD_LENGTHS = 20.0  # for which inputs are held, in ship lengths sailed: two turning circles
MOST_HELD = 5000  # samples of that
RUNS_AWAY = 10.0  # times as fast as in the data that no hull gets
UNEXPLAINED = f"its estimate from all runs predicts even these more than {FAR_WORSE:g} times as badly"
UNBIASED = ("iv", "oe", "ls")  # solvers, those first that noise biases least


@sealed(shares="n")
class HeldOut:
    """Errors of one method's predictions."""

    method: Method  # the method
    horizon_s: float | None  # of output error [s], None for whole runs
    outputs: tuple[str, ...]  # names
    shares: Array  # (n,) errors over standard deviations, geometric means over runs; nan where one never changes
    unseen: bool  # whether each run was predicted without it
    bounded: bool = True  # whether the model stays near the speeds of the data where its inputs are held
    # whether the estimate predicts the data it is from at most `FAR_WORSE` times as badly as others like it predicted
    # what they had not seen
    explains: bool = True
    # (runs,) means over outputs of the logarithms of each run's errors, the same runs of all methods, nan where the
    # others give the method no estimate; or not known
    of_runs: Array | None = None
    missed: Missed | None = None  # what predictions as long as a standard trial miss

    @property
    def label(self) -> str:
        """Name of the method, with the horizon of output error."""
        return self.label_of(self.method, self.horizon_s)

    @staticmethod
    def label_of(method: Method, horizon_s: float | None) -> str:
        """Of a method with a horizon."""
        if method.solver != "oe":
            return method.name
        return f"{method.name} over {'whole runs' if horizon_s is None else f'{horizon_s:g} s'}"

    @property
    def share(self) -> float:
        """Geometric mean over the outputs."""
        return _joined(self.shares)

    @property
    def sound(self) -> bool:
        """Whether what the comparison tells of the method is true of this estimate."""
        return self.bounded and self.explains


def _joined(shares: Array) -> float:
    """Geometric mean over outputs with a number; inf without one."""
    return float(np.exp(np.nanmean(np.log(shares)))) if np.isfinite(shares).any() else float("inf")


def ranked(found: Sequence[HeldOut]) -> list[int]:
    """Indices, the best first, estimates that are not sound last; of methods with equal errors the least biased first.

    Before these goes what makes the very error least that decides, where none is better for certain.
    """
    best = min((item for item in found if item.sound), key=lambda item: item.share, default=None)

    def place(index: int) -> tuple[bool, int, int, float]:
        item = found[index]
        if best is None or not item.sound:
            return True, 0, 0, item.share
        if _minimises_what_decides(item) and not certainly_worse(item, best):
            return False, 0, 0, item.share
        equal = _equal(item, best)
        return False, 1 if equal else 2, UNBIASED.index(item.method.solver) if equal else 0, item.share

    return sorted(range(len(found)), key=place)


def _minimises_what_decides(item: HeldOut) -> bool:
    return item.unseen and item.method.solver == "oe" and item.horizon_s == AHEAD_S


def _equal(item: HeldOut, best: HeldOut) -> bool:
    return item.share <= (1.0 + SAME_ERROR) * best.share


def certainly_worse(item: HeldOut, best: HeldOut) -> bool:
    """Whether errors are larger by more than chance makes them, by Student's interval of 95 % over paired runs."""
    if item.share > FAR_WORSE * best.share or item.of_runs is None or best.of_runs is None:
        return not _equal(item, best)
    more = item.of_runs - best.of_runs
    more = more[np.isfinite(more)]
    if len(more) < 2:
        return False
    error = scipy.special.stdtrit(len(more) - 1, 0.975) * more.std(ddof=1) / np.sqrt(len(more))
    return bool(more.mean() > error + np.log1p(SAME_ERROR))


def reason(found: Sequence[HeldOut], chosen: str, asked: Sequence[str]) -> str:
    """Why the estimate of a method is chosen, to follow its name; "" where nothing was compared.

    Args:
        chosen: label of the chosen one.
        asked: names of the methods asked for; none where they are the program's choice.
    """
    order = [found[place] for place in ranked(found)]
    own = next((item for item in order if item.label == chosen), None)
    if own is None:
        return ""
    least, others = min(order, key=lambda item: item.share), [item for item in order if item is not own]
    data = "unseen runs" if own.unseen else "the runs it is from"
    text = f"predicts {data} {AHEAD_S:g} s ahead with an error of {_bounded(own.share)}"
    if own is least:
        text += f", {others[0].label} with {_bounded(others[0].share)}" if others else ""
    elif own is order[0] and least.sound and _minimises_what_decides(own) and not _equal(own, least):
        text += (
            f", {least.label} with {_bounded(least.share)}, which so few runs do not tell from chance; "
            f"{own.label} fits such predictions themselves"
        )
    elif own is order[0] and least.sound and own.method.solver != least.method.solver:
        text += f", {least.label} with {_bounded(least.share)}; noise of the sensors biases {own.label} less"
    elif own is not order[0]:
        text += f"; the model of {order[0].label} cannot simulate every run"
    elif not least.bounded:
        text += f", {least.label} with {_bounded(least.share)}, but its model runs away where inputs are held"
    elif not least.explains:
        text += f", {least.label} with {_bounded(least.share)}, but {UNEXPLAINED}"
    if not own.explains:
        text += f"; but {UNEXPLAINED}"
    return f"{text}; output error starts from it" if asked and own.method.name not in asked else text


def _bounded(share: float) -> str:
    """An error in per cent; beyond `LARGEST_ERROR` it is not told."""
    return f"{100 * share:.3g} %" if share < LARGEST_ERROR else f"{100 * LARGEST_ERROR:g} % or more"


def folds(record: Record) -> Iterator[tuple[Record, Record]]:
    """(estimate from, predict): every run left out once, several at a time where there are many.

    A run that is most of the data is cut, but not into pieces shorter than a prediction.
    """
    most = MOST_OF_DATA * sum(map(len, record.batches))
    pieces = [piece for batch in record.batches for piece in _cut(batch, MOST_FOLDS if len(batch) > most else 1)]
    count = min(len(pieces), MOST_FOLDS)
    for number in range(count):
        rest, apart = (
            tuple(piece for place, piece in enumerate(pieces) if (place % count == number) is left_out)
            for left_out in (False, True)
        )
        yield replace(record, batches=rest), replace(record, batches=apart)


def _cut(batch: Batch, most: int) -> list[Batch]:
    """Pieces of equal length; two at least where more than one is asked for."""
    lasts = int(len(batch) * batch.sample_time_s / AHEAD_S)
    count = max(min(most, lasts), min(most, 2))
    ends = [round(len(batch) * number / count) for number in range(count + 1)]
    return [batch.cut(slice(first, end)) for first, end in itertools.pairwise(ends)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """What one estimate predicts with."""

    model: VesselModel
    # (2,) velocity of the water to north, east [m/s], where the method takes it for steady, else None: velocities over
    # ground are then predicted from those through water
    current: Array | None = None


Refit = Callable[[Record], Found]
"""The same method from other data; raises `NoAnswer` or `InputError` where there is no estimate."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A method with an estimate."""

    # method, horizon_s: as of `HeldOut`
    method: Method
    horizon_s: float | None
    found: Found  # the estimate
    wind: bool  # whether measured wind acts
    again: Refit  # the same from other data


def held_out(
    record: Record,
    candidates: Sequence[Candidate],
    *,
    ship: Vessel,
    seen_as: Callable[[Record], Record],
    integration: Integration,
) -> tuple[HeldOut, ...]:
    """Errors of the predictions of every candidate.

    Runs that no candidate can do without are left out of the comparison; where it could do without none, the errors are
    those on the data that the estimates are from.

    Args:
        ship: gives the limits of rudders, and the length.
        seen_as: what of a record is predicted.
    """
    apart: list[Batch] = []
    models: list[list[Found | None]] = []
    for rest, left_out in folds(record):
        row = [_model(candidate, rest) for candidate in candidates]
        if any(model is not None for model in row):
            own = seen_as(left_out).batches
            apart += own
            models += [row] * len(own)
    unseen = bool(apart)
    if not unseen:
        apart = list(seen_as(record).batches)
        models = [[candidate.found for candidate in candidates]] * len(apart)
    structures = [candidate.found.model for candidate in candidates]
    bounded = stay_bounded(structures, ship, seen_as(record).batches, integration)
    still: dict[bool, Ahead] = {}

    def in_water(item: Candidate, found: Sequence[Found | None]) -> list[Batch]:
        if not item.method.weather.steady:
            return apart
        return [_through_water(batch, own) for batch, own in zip(apart, found, strict=True)]

    def shares_of(item: Candidate, found: Sequence[Found | None]) -> Array:
        if item.method.weather.steady:
            moved = in_water(item, found)
            ahead = Ahead(structures[0], moved, wind=item.wind, integration=integration, spread=apart)
        else:
            if item.wind not in still:
                still[item.wind] = Ahead(structures[0], apart, wind=item.wind, integration=integration)
            ahead = still[item.wind]
        return ahead.shares(_models(found))

    def missed_by(item: Candidate, found: Sequence[Found | None]) -> Missed | None:
        moved = in_water(item, found)
        return missed(_models(found), moved, length_m=ship.length_m, wind=item.wind, integration=integration)

    each = [shares_of(item, [row[number] for row in models]) for number, item in enumerate(candidates)]
    own_data = [
        shares_of(item, [item.found] * len(apart)) if unseen else found
        for item, found in zip(candidates, each, strict=True)
    ]
    names = [batch.name for batch in apart]
    return tuple(
        HeldOut(
            method=candidate.method,
            horizon_s=candidate.horizon_s,
            outputs=candidate.found.model.outputs,
            shares=typical(shares),
            unseen=unseen,
            bounded=own,
            explains=_joined(typical(seen)) <= FAR_WORSE * _joined(typical(shares)),
            of_runs=by_run(np.where([[row[number] is None] for row in models], np.nan, shares), names),
            missed=missed_by(candidate, [row[number] for row in models]) if unseen else None,
        )
        for number, (candidate, shares, seen, own) in enumerate(zip(candidates, each, own_data, bounded, strict=True))
    )


def _models(found: Sequence[Found | None]) -> list[VesselModel | None]:
    return [None if own is None else own.model for own in found]


def _through_water(batch: Batch, found: Found | None) -> Batch:
    """The run in the frame of the water, in which a ship moves as she does in still water."""
    if found is None or found.current is None or batch.pose is None:
        return batch
    velocity = np.array(batch.velocity)
    velocity[:, :2] -= np.stack(rotated(found.current, -batch.pose[:, 2]), axis=1)
    return replace(batch, velocity=velocity)


def _model(candidate: Candidate, rest: Record) -> Found | None:
    try:
        return candidate.again(rest)
    except (NoAnswer, InputError):
        return None


def hardest(ship: Vessel, batches: Sequence[Batch]) -> tuple[Batch, ...]:
    """What was recorded where an input was least and where it was greatest, held; rudders are laid to their limits.

    Only rudders are: other actuators also stop and reverse a ship, of which data of a ship under way tell nothing.
    """
    names, step_s = batches[0].input_names, batches[0].sample_time_s
    inputs, velocity = (np.concatenate(rows) for rows in zip(*((b.inputs, b.velocity) for b in batches), strict=True))
    seen = np.isfinite(velocity).all(axis=1) & np.isfinite(inputs).all(axis=1)
    if not seen.any():
        return ()
    inputs, velocity = inputs[seen], velocity[seen]
    limits = dict(zip(ship.model.inputs, ship.limits, strict=True))
    rudders = np.array([name.startswith("rudder") and name in limits for name in names])
    count = 1 + HELD_LENGTHS * ship.length_m / max(_fastest(velocity, ship.length_m), 1e-9) / step_s

    def held(column: int, row: int, side: str) -> Batch:
        bounds = [getattr(limits.get(name, Limit()), side) for name in names]
        laid = rudders & rudders[column] & np.isfinite(bounds)
        return Batch(
            name=f"{names[column]} held",
            sample_time_s=step_s,
            input_names=names,
            inputs=np.tile(np.where(laid, bounds, inputs[row]), (min(round(count), MOST_HELD), 1)),
            velocity=np.tile(velocity[row], (min(round(count), MOST_HELD), 1)),
        )

    rows = ((inputs.argmin(axis=0), "low"), (inputs.argmax(axis=0), "high"))
    return tuple(held(column, int(row), side) for at, side in rows for column, row in enumerate(at))


def stay_bounded(
    models: Sequence[VesselModel], ship: Vessel, batches: Sequence[Batch], integration: Integration
) -> list[bool]:
    """Whether no point of the hull gets many times as fast as in the data, by model; all have one structure."""
    held = hardest(ship, batches)
    if not held:
        return [True] * len(models)
    structure = model_for(models[0], Record(batches=held))
    replay = build_replay(structure, Record(batches=held[:1]), integration)
    fastest = RUNS_AWAY * _fastest(np.concatenate([batch.velocity for batch in batches]), ship.length_m)

    def bounded(model: VesselModel) -> bool:
        try:
            return all(
                _fastest(replay.states(batch, model.parameters)[:, 3:], ship.length_m) < fastest for batch in held
            )
        except Diverged:
            return False

    return [bounded(model) for model in models]


def _fastest(velocity: Array, length_m: float) -> float:
    """The largest speed of bow or stern [m/s] of velocities (k, 3)."""
    u, v, r = velocity.T
    return float(np.nanmax(np.hypot(u, np.abs(v) + np.abs(r) * length_m / 2), initial=0.0))
