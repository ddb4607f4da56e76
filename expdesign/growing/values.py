"""Wishes for growing a dictionary, and what came of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from expdesign.dictionary import PrimitiveSpec
from expdesign.errors import InputError
from expdesign.information import PrimitiveInformation
from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True)
class GrowSettings:
    """How to search for manoeuvres that add to a dictionary.

    Attributes:
        families: names of those searched; () for all that the vessel can do.
        rounds: most primitives to add.
        tolerance: the search ends when no candidate found has a sensitivity above (1 + tolerance) x dimension.
        limits: (low, high) of u [m/s], v [m/s] and r [rad/s] through calm water that an addition must keep to; None
            for what the present dictionary spans.
        free_form: whether the commands of the best candidate are themselves optimised.
        run_s: length of an added run, or None for the middle length of the present runs.
        pool: candidates of every family that the search begins with.
        seed: of all chance; None for the command's.
    """

    families: tuple[str, ...] = ()
    rounds: int = 12
    tolerance: float = 0.01
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    free_form: bool = False
    run_s: float | None = None
    pool: int = 256
    seed: int | None = None

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise InputError(f"rounds is {self.rounds}, expected 1 or more")
        if not self.tolerance > 0:
            raise InputError(f"tolerance is {self.tolerance:g}, expected more than 0")
        if self.pool < 8:
            raise InputError(f"pool is {self.pool}, expected 8 or more")


@dataclass(frozen=True, kw_only=True)
class GrowRound:
    """One primitive that was added.

    Attributes:
        name, family, settings: of the addition.
        sensitivity: its d = trace(B(w)^-1 B) at the optimum before it came.
        searched: the largest d among candidates of the families, before commands were optimised freely.
        log_det_gain: what it adds to the optimal log det.
        efficiency: of the new optimum relative to the first, determinant to the power 1/p.
        excitation_condition: as of every primitive.
    """

    name: str
    family: str
    settings: Mapping[str, float]
    sensitivity: float
    searched: float
    log_det_gain: float
    efficiency: float
    excitation_condition: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Growth:
    """A grown dictionary.

    Attributes:
        specs: of the additions, in order.
        information: of the whole dictionary, additions last.
        rounds: what each addition brought.
        limits: (3, 2) low and high of u, v, r that were kept to.
        evaluated: number of candidates looked at.
        dimension: p, plus means when they are subtracted over the complete data.
        parameters: p.
        best_left: largest sensitivity that the search still finds at the end.
    """

    specs: tuple[PrimitiveSpec, ...]
    information: tuple[PrimitiveInformation, ...]
    rounds: tuple[GrowRound, ...]
    limits: Array
    evaluated: int
    dimension: int
    parameters: int
    best_left: float

    def __post_init__(self) -> None:
        seal(self, limits="3 2")

    @property
    def efficiency_left(self) -> float:
        """Efficiency at least, against any design over the candidates that were looked at: exp(-(d - dimension) / p).

        It says nothing about manoeuvres that the search did not come across.
        """
        return float(np.exp(-max(self.best_left - self.dimension, 0.0) / self.parameters))
