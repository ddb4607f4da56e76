"""Least information about causes that durations must give a diagnosis, linear in the time of every manoeuvre.

The noncentrality of a cause's test is a Schur complement of an information matrix that is linear in the durations, so
that a least noncentrality is a convex constraint. To distinguish one cause from another, the noncentrality that is left
while the other one is estimated too must be large enough: local T-optimality, as a constraint.

Sources: F. Pukelsheim, Optimal Design of Experiments (2006), 3.2; A. C. Atkinson and V. V. Fedorov, Biometrika 62
(1975), 57-70, for T-optimality; R. D. Cook and W. K. Wong, J. Amer. Statist. Assoc. 89 (1994), 687-692: a constrained
design is a compound one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.model import term_library
from expdesign.diagnosis.select import SELECTION_TUNING
from expdesign.dictionary import Primitive
from expdesign.errors import NoAnswer
from expdesign.foresight.added import ENDLESS, information_of_runs
from expdesign.foresight.effects import HiddenEffect, described, hidden_effects
from expdesign.foresight.foresee import effect_name, sizes_of
from expdesign.foresight.information import allowed_by_prior, beside_nuisance
from expdesign.foresight.power import freedom_of, level_of, needed_noncentrality
from expdesign.foresight.trial import Background, background, design_runs
from expdesign.foresight.values import WANTED_POWER
from expdesign.own_units import pseudo_inverse_of
from expdesign.progress import Progress, silent, within
from expdesign.simulation import Environment
from expdesign.values import Array, sealed
from expdesign.vessel import Vessel, VesselModel

NOT_BY_RUNS = ("change_point",)  # causes that are shown by when runs are sailed, not by which


@sealed(each="q d d", prior="d d")
class Wanted:
    """One effect that a trial must reveal, or distinguish from another."""

    # cause, effect: names
    cause: str
    effect: str
    size: float  # of the effect, in its unit; of several numbers the first
    unit: str  # of it
    apart_from: str  # the other cause, or ""
    # (q, d, d) information of one run of every manoeuvre: nuisance, the other effect if any, then the effect
    each: Array
    prior: Array  # (d, d)
    columns: int  # number of the effect's own rows, the last ones
    least: float  # noncentrality that is needed
    # freedom, level: of its test; where it is distinguished from another cause, of a gain that decides
    freedom: int
    level: float

    @property
    def within_std(self) -> bool:
        """No data suffice, as the effect is within the vessel file's standard deviations."""
        c = len(self.prior) - self.columns
        return allowed_by_prior(ENDLESS * self.each.sum(axis=0), self.prior[:c, :c], self.least)

    @property
    def name(self) -> str:
        """The wanted effect in words."""
        shown = self.cause if self.cause.endswith(f":{self.effect}") else f"{self.cause} as {self.effect}"
        return f"{shown} distinguished from {self.apart_from}" if self.apart_from else f"power to reveal {shown}"


def causes_by_runs(model: VesselModel) -> tuple[str, ...]:
    """Names of all causes that runs can show: of missing terms, those of the library that a model lacks."""
    names: list[str] = []
    for cause in CAUSES:
        terms = [f"missing_term:{name}" for name in term_library(model)] if cause.name == "missing_term" else []
        names += terms or ([cause.name] if cause.name not in ("missing_term", *NOT_BY_RUNS) else [])
    return tuple(names)


def told_apart_from(probability: float) -> float:
    """Noncentrality left with which the right cause leads by as much as a diagnosis asks for, with a probability.

    The lead of one cause over another nearly collinear one is Gaussian, with the noncentrality as mean and four times
    it as variance.
    """
    quantile = float(scipy.special.ndtri(probability))
    return (quantile + math.sqrt(quantile**2 + SELECTION_TUNING.equivalent_within)) ** 2


def told_apart_with(noncentrality: float) -> float:
    """The probability of `told_apart_from` at a noncentrality that is left."""
    lead = noncentrality - SELECTION_TUNING.equivalent_within
    return float(scipy.special.ndtr(lead / (2.0 * math.sqrt(noncentrality)))) if noncentrality > 0 else 0.0


def wanted(
    vessel: Vessel,
    primitives: Sequence[Primitive],
    weather: Environment,
    *,
    reveal: Sequence[str] = (),
    apart: Sequence[tuple[str, str]] = (),
    sizes: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> tuple[Wanted, ...]:
    """Every effect of the causes to reveal, and of both causes of every pair, with the information of every manoeuvre.

    Noise and the number of tests are those of a trial with one run of every manoeuvre.

    Args:
        primitives: q manoeuvres.
        apart: pairs of causes to tell apart.
        sizes: of causes, in the unit of their effects, instead of those that matter.

    Raises:
        NoAnswer: records of the trial cannot show a cause.
    """
    progress("simulating a diagnosis of the dictionary", 0.0)
    known = background(vessel, design_runs(primitives, [1] * len(primitives)), weather, seed=seed)
    causes = list(dict.fromkeys([*reveal, *(name for pair in apart for name in pair)]))
    tests = [test for test in known.tests if test.candidate.cause in causes]
    hidden = hidden_effects([test.candidate for test in tests], known.base, known.windows)
    for cause in causes:
        if not any(item.cause == cause for item in hidden):
            why = {one.name: one.unseen for one in CAUSES}.get(cause)
            why = why or "nothing that differs from the model and its uncertain parameters shows it"
            raise NoAnswer(f"design.reveal: no trial of this ship reveals {cause}: {why}")
    chosen = sizes_of(vessel, hidden, known, weather, stated=sizes, progress=within(progress, 0.4, 0.9))
    for item, own in zip(hidden, chosen, strict=True):
        if not all(math.isfinite(size.value) for size in own):
            raise NoAnswer(
                f"design.reveal: no size of {item.cause} as {effect_name(item, known)} is known that matters; "
                "design.reveal_sizes can state one"
            )
    progress("information of every manoeuvre about causes", 0.9)
    directions = [direction for item in hidden for direction in item.directions]
    values = [size.value for own in chosen for size in own]
    each = information_of_runs(vessel, known.base, primitives, weather, directions, values)
    ends = np.cumsum([len(item.directions) for item in hidden]) + len(known.base.keys)
    rows = [np.arange(end - len(item.directions), end) for end, item in zip(ends.tolist(), hidden, strict=True)]
    several = _Several(
        known=known,
        hidden=hidden,
        sizes=tuple(tuple(size.value for size in own) for own in chosen),
        rows=tuple(rows),
        each=each,
    )
    return (
        *(several.revealed(place) for place, item in enumerate(hidden) if item.cause in reveal),
        *(several.distinguished(place, other) for pair in apart for one, other in (pair, pair[::-1])
          for place, item in enumerate(hidden) if item.cause == one),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class _Several:
    """Hidden effects with the information of every manoeuvre about all of them."""

    known: Background  # the trial that gave noise and tests
    hidden: tuple[HiddenEffect, ...]  # the effects; sizes: of their directions; rows: of each in the information
    sizes: tuple[tuple[float, ...], ...]
    rows: tuple[Array, ...]
    each: Array  # (q, c + m, c + m)

    def revealed(self, place: int) -> Wanted:
        """An effect with the wanted power."""
        item = self.hidden[place]
        test = next(test for test in self.known.tests if test.candidate is item.candidate)
        freedom, level = freedom_of(item.candidate), level_of(test.multiplicity)
        least = needed_noncentrality(WANTED_POWER, freedom, level)
        return self._wanted(place, (), "", (least, freedom, level))

    def distinguished(self, place: int, other: str) -> Wanted:
        """An effect distinguished from the most similar one of another cause."""
        precision = self.known.base.precision
        A = beside_nuisance(self.each.sum(axis=0), precision)
        own = self.rows[place] - len(precision)
        likeness = []
        for number, item in enumerate(self.hidden):
            if item.cause == other:
                index = self.rows[number] - len(precision)
                likeness.append((likeness_of(A, own, index), number))
        beside = self.rows[max(likeness)[1]]
        return self._wanted(place, tuple(beside.tolist()), other, (told_apart_from(WANTED_POWER), 1, 0.0))

    def _wanted(self, place: int, beside: tuple[int, ...], other: str, test: tuple[float, int, float]) -> Wanted:
        precision, own = self.known.base.precision, self.rows[place]
        index = np.array([*range(len(precision)), *beside, *own.tolist()], dtype=int)
        prior = np.zeros((len(index), len(index)))
        prior[: len(precision), : len(precision)] = precision
        least, freedom, level = test
        _, factor, unit = described(self.hidden[place].directions[0], self.known.base.ship)
        return Wanted(
            cause=self.hidden[place].cause,
            effect=effect_name(self.hidden[place], self.known),
            size=factor * self.sizes[place][0],
            unit=unit,
            apart_from=other,
            each=self.each[:, index[:, None], index],
            prior=prior,
            columns=len(own),
            least=least,
            freedom=freedom,
            level=level,
        )


def likeness_of(A: Array, own: Array, others: Array) -> float:
    """How much of some effects' information others imitate: the sum of their squared canonical correlations, at most c.

    Args:
        A: (m, m) information about all.
        own: (c,) rows of the effects.
        others: (d,) rows of the others.
    """
    cross = A[np.ix_(own, others)]
    imitated = cross @ pseudo_inverse_of(A[np.ix_(others, others)]) @ cross.T
    return float(np.trace(pseudo_inverse_of(A[np.ix_(own, own)]) @ imitated))
