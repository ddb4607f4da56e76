"""What is foreseen of a trial."""

from __future__ import annotations

import math
from dataclasses import dataclass

from expdesign.foresight.effects import HiddenEffect

TOLD_APART = 0.5  # probability below which two causes count as not told apart

WANTED_POWER = 0.9  # of a cause that counts as revealed


@dataclass(frozen=True)
class Confusion:
    """A cause that a hidden effect may be taken for."""

    cause: str  # the other cause
    cosine: float  # between both directions, beside nuisance; 1 where no data of this trial tell them apart
    noncentrality: float  # of the hidden effect where the other cause is free
    told_apart: float  # probability that the likelihood prefers the right one by as much as a diagnosis asks for


@dataclass(frozen=True, kw_only=True, eq=False)
class AddedRuns:
    """Whole runs that bring a cause to the wanted power."""

    runs: tuple[tuple[str, int], ...]  # (name of the manoeuvre, number)
    time_s: float  # of all of them


@dataclass(frozen=True, kw_only=True, eq=False)
class Foreseen:
    """One hidden effect."""

    effect: HiddenEffect  # how the cause acts
    name: str  # in results
    change: float  # of that number, at the size that matters; nan where no size is known
    unit: str  # of it
    rule: str  # why this size matters
    noncentrality: float  # of its test
    freedom: int  # numbers tested at once
    level: float  # p-value of the test alone that is accepted
    power: float  # probability that the test of its cause finds it
    found: float  # probability that a diagnosis finds it: held-out runs are then simulated or predicted better too
    named: float  # probability that a diagnosis finds it and no other cause explains the data better
    least_change: float  # change of the same number with the wanted power; infinite where there is none
    confusions: tuple[Confusion, ...] = ()  # causes that it is not told apart from
    # the manoeuvre whose added runs bring it to the wanted power soonest; None where none does, or none is needed
    added: AddedRuns | None = None
    best_power: float = 0.0  # largest power with added runs of one manoeuvre
    within_std: bool = False  # no data suffice, as the effect is within the vessel file's standard deviations

    @property
    def cause(self) -> str:
        """Name in the catalogue."""
        return self.effect.cause

    @property
    def sized(self) -> bool:
        """Whether a size is known that matters."""
        return not math.isnan(self.change)

    @property
    def needs_runs(self) -> bool:
        """Whether it lacks the wanted power at the size that matters."""
        return self.sized and self.power < WANTED_POWER

    @property
    def mistaken_for(self) -> tuple[Confusion, ...]:
        """Causes that it is more often than not mistaken for, or not told apart from, where its test finds it."""
        return tuple(item for item in self.confusions if item.told_apart < TOLD_APART)


@dataclass(frozen=True, kw_only=True, eq=False)
class Foresight:
    """What a diagnosis of a trial would find."""

    effects: tuple[Foreseen, ...]  # in the order of the catalogue
    unseen: tuple[tuple[str, str], ...]  # (cause, why) of causes that these records cannot show
    duration_s: float  # of the trial
    wanted_power: float  # of what counts as revealed
    random_current_mps: float  # standard deviation of the wandering current that the diagnosis allows for
    # runs that bring every effect which can be brought there to the wanted power; None where none is needed, or no runs
    # are offered
    together: AddedRuns | None = None
    beyond: tuple[Foreseen, ...] = ()  # effects that no runs of the dictionary bring there

    @property
    def weakest(self) -> tuple[Foreseen, ...]:
        """The effect with the least power of every cause; among equals the one that is nearest to being missed."""
        least: dict[str, Foreseen] = {}
        for item in self.effects:
            known = least.get(item.cause)
            if known is None or (item.sized and not known.sized) or _margin(item) < _margin(known):
                least[item.cause] = item
        return tuple(least.values())

    @property
    def missed(self) -> tuple[str, ...]:
        """Causes of which some effect lacks the wanted power."""
        return tuple(item.cause for item in self.weakest if item.power < self.wanted_power)

    @property
    def not_told_apart(self) -> tuple[tuple[Foreseen, Confusion], ...]:
        """Effects that their own test finds more often than not, with the causes that they are not told apart from."""
        return tuple((item, other) for item in self.effects if item.power >= TOLD_APART for other in item.mistaken_for)


def _margin(item: Foreseen) -> float:
    """Size over that with the wanted power; infinite where no size is known."""
    return abs(item.change) / item.least_change if item.sized and item.least_change > 0 else math.inf
