"""Causes that were named before, as by a watch: tested first, each alone, with the ship else as her file states her.

What was named beforehand is one question, whose p-value needs no allowance for all others that could be asked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from expdesign.diagnosis.causes import Candidate, rounded
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import Fit, fit, tail
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion import fitted_start
from expdesign.diagnosis.select.score_tests import ScoreTest, score_tests
from expdesign.diagnosis.select.tuning import TUNING
from expdesign.vessel.quantities import effect_row

LEAST_P = 1e-15
"""That is told as a number."""


@dataclass(frozen=True, kw_only=True)
class Suspected:
    """A test of an effect that was named before."""

    effect: str  # its key
    value: float  # estimate of its change; std: standard error
    std: float
    p_value: float  # of the vessel file without it; not adjusted, as it is one question
    whole: float = 0.0  # the file's value of a parameter; zero for other effects

    @property
    def confirmed(self) -> bool:
        """Whether the data show it."""
        return self.p_value <= TUNING.level

    @property
    def in_words(self) -> str:
        """The outcome."""
        unit = effect_row(self.effect).unit
        size = f"{rounded(self.value, self.std)}{' ' * bool(unit)}{unit}"
        if self.whole or unit == "rad":  # as a watch tells it
            factor, other = (100.0 / self.whole, "%") if self.whole else (math.degrees(1.0), "degrees")
            size += f" ({rounded(factor * self.value, abs(factor) * self.std)} {other})"
        answer = "the data show it" if self.confirmed else "the data do not show it"
        name, chance = self.effect.removeprefix("theta:"), max(self.p_value, LEAST_P)
        return f"tested first and alone, {answer}: {name} by {size}, p {'=' if chance > LEAST_P else '<'} {chance:.2g}"


def suspected_tests(ship: ExtendedModel, windows: Windows, effects: Sequence[str]) -> tuple[Suspected, ...]:
    """Tests of effects, most certain first; those that the data cannot show are left out.

    Args:
        ship: the model in use, whose parameters and statements are taken as known here.
        effects: keys of the extended model, such as "gain" or "theta:X_uu".
    """
    if not effects:
        return ()
    known = replace(ship, model=replace(ship.model, parameter_std=np.zeros(len(ship.model.names))), stated_std={})
    starts = fitted_start(known, windows)
    base = fit(known, windows, (), starts=starts)
    tests = score_tests(base, [Candidate(cause="suspected", free={key: 0.0}) for key in effects])
    return tuple(sorted((_fitted(base, windows, test) for test in tests), key=lambda one: one.p_value))


def _fitted(base: Fit, windows: Windows, test: ScoreTest) -> Suspected:
    """The effect alone at its best value, with the noise that is left beside it, and how much runs differ."""
    (key,) = test.candidate.free
    found = fit(base.ship, windows, (key,), starts=base.starts)
    value, place = found.value(key) - base.ship.get(key), found.keys.index(key)
    std = float(np.sqrt(found.covariance[place, place]))
    named = key.removeprefix("theta:")
    whole = dict(zip(base.ship.model.names, base.ship.model.parameters.tolist(), strict=True)).get(named, 0.0)
    return Suspected(
        effect=key, whole=whole if key != named else 0.0, value=value, std=std * float(np.sqrt(test.factor)),
        p_value=tail((value / std) ** 2, 1, test.factor, test.freedom),
    )  # fmt: skip
