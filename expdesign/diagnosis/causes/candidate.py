"""A cause of the catalogue: its name, its candidates and its explanation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One way in which a cause may act."""

    cause: str  # name in the catalogue
    # effects to estimate, with a first guess each; zero where the effect is smooth around zero
    free: Mapping[str, float]
    # effects that say which candidate it is, e.g. the roll period.
    fixed: Mapping[str, float] = field(default_factory=dict)
    finite: bool = False  # the effect is not smooth at zero; it is tried at the first guess as a whole
    positive: bool = False  # its size cannot be below zero, so that only a positive one counts as a sign of it
    # effect whose value is found by trying these once the candidate is singled out, as the likelihood has corners in it
    grid: tuple[str, tuple[float, ...]] | None = None
    bounds: tuple[Mapping[str, float], ...] = ()  # weighted sums of effects that physics keeps from being positive
    above: Mapping[str, float] = field(default_factory=dict)  # effects that the data show only above these values
    below: Mapping[str, float] = field(default_factory=dict)  # effects that the ship can have only below these values
    # its numbers imitate many causes; one with fewer numbers that explains nearly as much comes first
    imitates: bool = False

    def is_possible(self, value: Callable[[str], float]) -> bool:
        """Whether effects with these values keep all bounds."""
        kept = all(sum(weight * value(key) for key, weight in bound.items()) <= 0.0 for bound in self.bounds)
        above = all(value(key) > least for key, least in self.above.items())
        return kept and above and all(value(key) < most for key, most in self.below.items())

    @property
    def size(self) -> int:
        """Numbers that screening tests at once."""
        return 1 if self.finite else len(self.free)


@dataclass(frozen=True, kw_only=True, eq=False)
class Situation:
    """The present model and the data."""

    ship: ExtendedModel
    windows: Windows

    def has(self, key: str) -> bool:
        """The effect is already in the model."""
        return key in self.ship.effects


Values = Mapping[str, tuple[float, float]]
"""Effect -> (estimate, standard error)."""


@dataclass(frozen=True, kw_only=True)
class Cause:
    """An entry of the catalogue."""

    name: str  # in the vocabulary of diagnosis.json
    title: str  # of its section in reports
    missing: str  # from the simulation, e.g. "a current"; "" where it depends on which term
    summary: str  # what is wrong, in a few words
    candidates: Callable[[Situation], tuple[Candidate, ...]]  # for a situation; none if the data cannot show the cause
    # one or two sentences for a person, from the estimates and the model they are of
    explain: Callable[[Values, ExtendedModel], str]
    unseen: str = ""  # when records cannot show it


PLUS_MINUS = "\N{PLUS-MINUS SIGN}"


def rounded(value: float, std: float) -> str:
    """A value to the second digit of its standard error."""
    if not (std > 0 and math.isfinite(std)):
        return f"{value:.4g}"
    decimals = max(0, 1 - math.floor(math.log10(std)))
    if decimals > 5:
        return f"{value:.3g} {PLUS_MINUS} {std:.2g}"
    return f"{value:.{decimals}f} {PLUS_MINUS} {std:.{decimals}f}"


def from_zero(value: float, std: float) -> str:
    """A size that cannot be below zero: of one that may be zero, how large it is at most."""
    return f"at most {value + 2.0 * std:.2g}" if may_be_zero(value, std) else rounded(value, std)


def may_be_zero(value: float, std: float) -> bool:
    """Whether two standard errors reach zero."""
    return math.isfinite(std) and value <= 2.0 * std


def listed(values: Values, unit: str = "") -> str:
    """Every estimate with the last part of its key."""
    return ", ".join(f"{key.split(':')[-1]} {rounded(value, std)}{unit}" for key, (value, std) in values.items())


def first(values: Values) -> tuple[str, float, float]:
    """Key, value and standard error of the first estimate."""
    key, (value, std) = next(iter(values.items()))
    return key, value, std
