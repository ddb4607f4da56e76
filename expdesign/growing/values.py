"""Settings and results of the growth of a dictionary."""

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
    """Settings of the search for manoeuvres that add information to a dictionary.

    Attributes:
        families: names of the searched families; () for all that the vessel can do.
        rounds: most primitives to add.
        tolerance: the search ends when no candidate found has a sensitivity above (1 + tolerance) x dimension.
        limits: key -> (low, high) of u [m/s], v [m/s] and r [rad/s] of an addition in calm water; without a key, the
            range of the present dictionary.
        free_form: whether the commands of the best candidate are optimised.
        run_s: duration of an added run [s], or None for the median duration of the present runs.
        pool: initial candidates of every family.
        seed: of the search; None for the command's.
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
        sensitivity: its d = trace(B(w)^-1 B) at the optimum without it.
        searched: the largest d among candidates of the families, before commands were optimised.
        log_det_gain: increase of the optimal log det.
        efficiency: ratio of the new optimum to the first, determinant to the power 1/p.
        excitation_condition: as in `PrimitiveInformation`.
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
        rounds: one for each addition.
        limits: (3, 2) low and high of u, v, r of all additions.
        evaluated: number of evaluated candidates.
        dimension: p, plus means with complete mean subtraction.
        parameters: p.
        best_left: largest sensitivity found at the end.
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
        """Least efficiency against any design over the evaluated candidates: exp(-(d - dimension) / p).

        Other manoeuvres may be more informative.
        """
        return float(np.exp(-max(self.best_left - self.dimension, 0.0) / self.parameters))
