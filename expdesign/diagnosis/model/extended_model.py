"""A simulation model with effects added to it; each cause of the catalogue has a few effects, zero without it.

Their keys are those of `quantities.EFFECTS`.

The search begins at the values that the vessel file states; every test is of the difference.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.model.terms import (
    Effects,
    ScaledTerm,
    input_products,
    library_terms,
    own_terms,
    turns_by_force,
    unit_terms,
)
from expdesign.simulation.program import Evaluation, evaluation
from expdesign.values import Array
from expdesign.vessel import Roll, Term, VesselModel
from expdesign.vessel.quantities import GAINS_AND_OFFSETS, effect_row
from expdesign.vessel.structures import Expression
from expdesign.waves import G_MPS2

ANGLE_STEMS = ("a", "rudder")
ROLL = {"roll:period": "period_s", "roll:damping": "damping_ratio", "roll:sway": "Y_phi", "roll:yaw": "N_phi"}
"""Effect -> attribute of a `Roll`."""
LEAST_HEIGHT = 0.01
"""Metacentric height over beam of a ship that is hardly stable; a ship of 9 m has the 0.15 m that the code asks for at
0.017."""
SLIGHTLY = 1e-6  # distance from a bound that is rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class ExtendedModel:
    """A model with effects."""

    model: VesselModel  # driven by the recorded inputs
    library: Mapping[str, Term]  # terms that the model lacks, by name
    # draught_m, length_m, beam_m: of the ship [m]
    draught_m: float
    length_m: float
    beam_m: float
    derived: tuple[str, ...] = ()  # those of u, v, r that the data derive from the pose, by its sensors
    max_draught_over_depth: float = 0.0  # largest draught over depth in the data, 0 where no depth is known
    effects: Effects = field(default_factory=dict)  # key -> value; others are zero
    # effects as the vessel file states them; stated_std: standard deviations of those that it is unsure of
    stated: Effects = field(default_factory=dict)
    stated_std: Effects = field(default_factory=dict)
    # effect -> least and greatest value that instruments of the record show of each other
    shown: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @cached_property
    def scaled_terms(self) -> tuple[ScaledTerm, ...]:
        """The model's own terms, then those of the library that were added, with their factors."""
        return (*own_terms(self.model, self.effects), *library_terms(self.model, self.library, self.effects))

    @cached_property
    def regressors(self) -> Evaluation:
        """Regressors of `scaled_terms`, to be evaluated together."""
        return evaluation([part.expression for part in self.scaled_terms])

    @cached_property
    def combined_terms(self) -> tuple[tuple[int, ...], list[tuple[int, Array]]]:
        """(t,) rows of `scaled_terms` ordered by equation; of u, v and r the first row, and factors of all its rows."""
        order = [[place for place, part in enumerate(self.scaled_terms) if part.equation == name] for name in OUTPUTS]
        rows = np.argsort([place for places in order for place in places]).tolist()
        first = [0, *itertools.accumulate(map(len, order))]
        own = [np.array([self.factor(self.scaled_terms[place]) for place in places]) for places in order]
        return tuple(rows), list(zip(first, own, strict=False))

    @cached_property
    def changes(self) -> list[Array] | None:
        """Of u, v and r, by how much a change of the ship changes the factors of their rows; None without a change."""
        if not any(part.after for part in self.scaled_terms):
            return None
        rows, factors = self.combined_terms
        shares = np.array([part.after / part.factor if part.after else 0.0 for part in self.scaled_terms])
        shares = shares[np.argsort(rows)]
        return [own * shares[first : first + len(own)] for first, own in factors]

    def factor(self, part: ScaledTerm) -> float:
        """Factor of a term in its rate: over the inertia, but for ratios of inertias."""
        return part.factor if part.coriolis else part.factor / (1 + self.get(f"inertia:{part.equation}"))

    @property
    def input_products(self) -> Mapping[str, Expression]:
        """What inputs alone make, by the signal that the terms read instead."""
        return input_products(self.model, tuple(self.library.values()))

    @cached_property
    def unit_terms(self) -> Mapping[str, ScaledTerm]:
        """Effect -> term by which its unit changes the rates, for parameters and library terms: they act linearly."""
        return unit_terms(self.model, self.library, self.effects)

    def with_effects(self, effects: Effects) -> ExtendedModel:
        """The model with some effects set to other values."""
        return replace(self, effects={**self.effects, **effects})

    def without_effects(self, keys: Set[str]) -> ExtendedModel:
        """The model with some effects as the vessel file states them, if it does."""
        others = {key: value for key, value in self.effects.items() if key not in keys}
        return replace(self, effects=others | {key: value for key, value in self.stated.items() if key in keys})

    def with_known_parameters(self) -> ExtendedModel:
        """The model whose parameters count as known."""
        return replace(self, model=replace(self.model, parameter_std=np.zeros(len(self.model.parameters))))

    def has_found(self, prefix: str) -> bool:
        """Whether an effect whose key begins so differs from the vessel file, which does not say how sure it is."""
        return any(
            key.startswith(prefix) and value != self.stated.get(key) and key not in self.stated_std
            for key, value in self.effects.items()
        )

    def gain_and_offset(self, signal: str) -> tuple[float, float]:
        """With which sensors show u, v or r: gain * true + offset."""
        own = [row for row in GAINS_AND_OFFSETS if signal in row.signals]
        gain = math.prod(1.0 + self.get(row.effects[0]) for row in own if row.is_gain)
        return gain, sum(self.get(row.effects[0]) for row in own if not row.is_gain)

    def get(self, key: str) -> float:
        """Value of an effect."""
        return self.effects.get(key, 0.0)

    def bounds(self, key: str) -> tuple[float, float]:
        """Least and greatest possible value of an effect by its kind and the instruments.

        What the vessel file states is possible.
        """
        kind, _, which = key.partition(":")
        sizes = {"forward": self.length_m, "starboard": self.beam_m, "asymmetry": self.beam_m / 2}
        row = effect_row(key)
        low, high = row.low, row.high
        if kind == "lever" or (kind == "asymmetry" and turns_by_force(self.model)):
            low, high = -sizes[which or kind], sizes[which or kind]
        elif key == "roll:period":
            high = self.longest_roll_s
        least, most = self.shown.get(key, (low, high))
        low, high = max(low, least), min(high, most)
        stated = self.stated.get(key, 0.0)
        return min(low, stated), max(high, stated)

    def is_possible(self, keys: Iterable[str]) -> bool:
        """Whether effects lie within their bounds, and not at one of them, except where that means no effect."""
        for key in keys:
            value, (low, high) = self.get(key), self.bounds(key)
            if not (value - low > (SLIGHTLY if low else -SLIGHTLY) and high - value > SLIGHTLY):
                return False
        return True

    @property
    def has_roll(self) -> bool:
        """Roll is part of the motion."""
        return "roll:period" in self.effects

    @cached_property
    def roll(self) -> Roll | None:
        """The mode."""
        if not self.has_roll:
            return None
        return Roll(**{name: self.get(key) for key, name in ROLL.items()})

    @property
    def longest_roll_s(self) -> float:
        """Longest natural period of a ship of this beam that is stable: T = 2 pi k / sqrt(g GM) [s].

        The radius of gyration k is at most half of the beam, and the metacentric height GM at least `LEAST_HEIGHT` of
        it. Source: IMO, Intact Stability Code (2008), 2.3.4, whose T = 2 C B / sqrt(GM) has C from 0.3 to 0.5.
        """
        return math.pi * math.sqrt(self.beam_m / (G_MPS2 * LEAST_HEIGHT))

    @property
    def states(self) -> int:
        """u, v, r, and with roll its angle and rate."""
        return 5 if self.has_roll else 3


def mean_wind(ship: ExtendedModel) -> tuple[float, float]:
    """Velocity to north and east of the wind where none is measured [m/s]."""
    speed, toward = ship.get("wind:speed"), ship.get("wind:toward")
    return ship.get("wind:north") + speed * math.cos(toward), ship.get("wind:east") + speed * math.sin(toward)
