"""What is foreseen of a trial."""

from __future__ import annotations

import math
from dataclasses import dataclass

from expdesign.foresight.effects import HiddenEffect
from expdesign.foresight.tuning import TUNING

WANTED_POWER = 0.9  # of a cause that counts as revealed


@dataclass(frozen=True)
class Confusion:
    """A cause that a hidden effect may be taken for.

    Attributes:
        cause: the other cause.
        cosine: between both directions, beside nuisance; 1 where no data of this trial tell them apart.
        noncentrality: of the hidden effect where the other cause is free.
        told_apart: probability that the likelihood prefers the right one by as much as a diagnosis asks for.
    """

    cause: str
    cosine: float
    noncentrality: float
    told_apart: float


@dataclass(frozen=True, kw_only=True, eq=False)
class AddedRuns:
    """Whole runs that bring a cause to the wanted power.

    Attributes:
        runs: (name of the manoeuvre, number).
        time_s: of all of them.
    """

    runs: tuple[tuple[str, int], ...]
    time_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Foreseen:
    """One hidden effect.

    Attributes:
        effect: how the cause acts.
        name: in results.
        change: of that number, at the size that matters; nan where no size is known.
        unit: of it.
        rule: why this size matters.
        noncentrality: of its test.
        freedom: numbers tested at once.
        level: p-value of the test alone that is accepted.
        power: probability that the test of its cause finds it.
        found: probability that a diagnosis finds it: held-out runs are then simulated or predicted better too.
        named: probability that a diagnosis finds it and no other cause explains the data better.
        least_change: change of the same number with the wanted power; infinite where there is none.
        confusions: causes that it is not told apart from.
        added: the manoeuvre whose added runs bring it to the wanted power soonest; None where none does, or none is
            needed.
        best_power: largest power with added runs of one manoeuvre.
        within_std: no data suffice, as the effect is within the vessel file's standard deviations.
    """

    effect: HiddenEffect
    name: str
    change: float
    unit: str
    rule: str
    noncentrality: float
    freedom: int
    level: float
    power: float
    found: float
    named: float
    least_change: float
    confusions: tuple[Confusion, ...] = ()
    added: AddedRuns | None = None
    best_power: float = 0.0
    within_std: bool = False

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
        return tuple(item for item in self.confusions if item.told_apart < TUNING.told_apart)


@dataclass(frozen=True, kw_only=True, eq=False)
class Foresight:
    """What a diagnosis of a trial would find.

    Attributes:
        effects: in the order of the catalogue.
        unseen: (cause, why) of causes that these records cannot show.
        duration_s: of the trial.
        wanted_power: of what counts as revealed.
        random_current_mps: standard deviation of the wandering current that the diagnosis allows for.
        together: runs that bring every effect which can be brought there to the wanted power; None where none is
            needed, or no runs are offered.
        beyond: effects that no runs of the dictionary bring there.
    """

    effects: tuple[Foreseen, ...]
    unseen: tuple[tuple[str, str], ...]
    duration_s: float
    wanted_power: float
    random_current_mps: float
    together: AddedRuns | None = None
    beyond: tuple[Foreseen, ...] = ()

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
        return tuple(
            (item, other) for item in self.effects if item.power >= TUNING.told_apart for other in item.mistaken_for
        )


def _margin(item: Foreseen) -> float:
    """Size over that with the wanted power; infinite where no size is known."""
    return abs(item.change) / item.least_change if item.sized and item.least_change > 0 else math.inf
