"""The search for the candidate that adds most: a quasi-random pool, then local random steps from each family's best.

A candidate's matrix does not depend on the design, so every candidate ever simulated is kept and compared with each
new design at the cost of one product. What the search guarantees is exactly that: no candidate that it looked at has a
larger sensitivity than it reports. It is not a bound over the whole of the families.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from expdesign.dictionary import PrimitiveSpec
from expdesign.dictionary.batch import excite_many
from expdesign.growing.space import FamilySpace
from expdesign.information.many import bordered_runs
from expdesign.progress import Progress, silent
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel

SLACK = 1e-9
"""Violation of a limit that is rounding."""
FEWEST = 8
"""Candidates of a family that are simulated one by one at least."""
BATCH = 512
"""Runs simulated at once."""
CLOSED_LOOP_SHARE = 32
"""Families that must be simulated one by one get so many times fewer candidates, and no local steps."""
LEADERS = 4
"""Best candidates of each family from which local steps start."""
OFFSPRING = 6
"""Local steps from each leader at once."""
STRIDES = (0.25, 0.15, 0.1, 0.06, 0.04, 0.025, 0.015, 0.01)
"""Sizes of local steps, one generation each, as shares of each setting's range."""
REDRAWN = 0.3
"""Share of local steps that take another random draw, where the family has one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measure:
    """What makes a matrix and a violation of limits of a request.

    Attributes:
        vessel, names, environment, mean_subtraction: as in `information.many.bordered_runs`.
        limits: (3, 2) low and high of u, v, r.
    """

    vessel: Vessel
    names: tuple[str, ...]
    environment: Environment
    mean_subtraction: str
    limits: Array

    def __call__(self, specs: Sequence[PrimitiveSpec]) -> tuple[Array, Array]:
        """Matrices B (n, d, d) and violations (n,), which are infinite for runs that cannot be."""
        pieces = [self._some(specs[first : first + BATCH]) for first in range(0, len(specs), BATCH)]
        return np.concatenate([B for B, _ in pieces]), np.concatenate([excess for _, excess in pieces])

    def _some(self, specs: Sequence[PrimitiveSpec]) -> tuple[Array, Array]:
        runs = excite_many(self.vessel, specs)
        matrices, motion = bordered_runs(
            self.vessel,
            runs.commands,
            runs.velocity,
            self.names,
            environment=self.environment,
            mean_subtraction=self.mean_subtraction,
            standing=runs.entry_inputs,
        )
        over = violation(motion, self.limits)
        sound = (runs.possible > 0) & np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(over)
        return np.where(sound[:, None, None], matrices, 0.0), np.where(sound, over, np.inf)


def violation(motion: Array, limits: Array) -> Array:
    """(n,) largest excess of motions (n, k, 3) over limits (3, 2), in units of their ranges."""
    low, high = limits.T
    excess = np.maximum(motion - high, low - motion) / np.maximum(high - low, 1e-12)
    return np.asarray(np.maximum(excess.max(axis=(1, 2)), 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Archive:
    """Every candidate of one family that was looked at.

    Attributes:
        space: the family's.
        points: (n, a) places in the unit cube.
        matrices: (n, d, d) B of each.
        excess: (n,) violations of the limits.
    """

    space: FamilySpace
    points: Array
    matrices: Array
    excess: Array

    def merits(self, inverse: Array) -> Array:
        """(n,) sensitivity of those within limits, minus the violation of the others."""
        d = np.einsum("ij,nji->n", inverse, self.matrices)
        return np.where(self.excess <= SLACK, d, -self.excess)

    def with_more(self, other: Archive) -> Archive:
        """Both together."""
        return Archive(
            space=self.space,
            points=np.concatenate([self.points, other.points]),
            matrices=np.concatenate([self.matrices, other.matrices]),
            excess=np.concatenate([self.excess, other.excess]),
        )


def pool_of(spaces: Sequence[FamilySpace], measure: Measure, *, pool: int, seed: int) -> tuple[Archive, ...]:
    """Quasi-random candidates of every family, `pool` or the next power of two of each."""
    points = []
    for number, space in enumerate(spaces):
        count = max(FEWEST, pool // CLOSED_LOOP_SHARE) if space.family.closed_loop else pool
        sobol = qmc.Sobol(len(space.axes), rng=np.random.default_rng([seed, number]))
        points.append(sobol.random_base2(int(np.ceil(np.log2(count)))))
    return _measured(spaces, points, measure)


def refined(
    archives: Sequence[Archive],
    inverse: Array,
    measure: Measure,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> tuple[Archive, ...]:
    """The archives with local steps from each family's best candidates for a design with B^-1 (d, d)."""
    spaces, grown = [archive.space for archive in archives], tuple(archives)
    for generation, stride in enumerate(STRIDES):
        progress("searching for runs that add more information", generation / len(STRIDES))
        points = [_steps(archive, inverse, stride, rng) for archive in grown]
        more = _measured(spaces, points, measure)
        grown = tuple(archive.with_more(other) for archive, other in zip(grown, more, strict=True))
    return grown


def best_of(archives: Sequence[Archive], inverse: Array) -> tuple[PrimitiveSpec | None, float]:
    """The candidate of largest sensitivity within limits, and that; None and -inf where there is none."""
    merits = [archive.merits(inverse) for archive in archives]
    winner = int(np.argmax([values.max() for values in merits]))
    place, archive = int(np.argmax(merits[winner])), archives[winner]
    if archive.excess[place] > SLACK:
        return None, -np.inf
    return archive.space.spec(archive.points[place]), float(merits[winner][place])


def _steps(archive: Archive, inverse: Array, stride: float, rng: np.random.Generator) -> Array:
    """(n, a) points near the family's best ones."""
    if archive.space.family.closed_loop:
        return archive.points[:0]
    order = np.argsort(-archive.merits(inverse), kind="stable")[:LEADERS]
    parents = np.repeat(archive.points[order], OFFSPRING, axis=0)
    steps = stride * rng.standard_normal(parents.shape)
    moved = rng.random(parents.shape) < max(0.4, 1.0 / parents.shape[1])
    for index, axis in enumerate(archive.space.axes):
        if axis.scale == "whole":
            redrawn = rng.random(len(parents)) < REDRAWN
            steps[:, index] = np.where(redrawn, rng.random(len(parents)) - parents[:, index], 0.0)
            moved[:, index] = True
    return np.clip(parents + np.where(moved, steps, 0.0), 0.0, 1.0 - 1e-12)


def _measured(spaces: Sequence[FamilySpace], points: Sequence[Array], measure: Measure) -> tuple[Archive, ...]:
    """Candidates of every family, simulated together."""
    matrices, excess = measure(
        [space.spec(point) for space, rows in zip(spaces, points, strict=True) for point in rows]
    )
    ends = np.cumsum([len(rows) for rows in points])[:-1]
    return tuple(
        Archive(space=space, points=rows, matrices=found, excess=over)
        for space, rows, found, over in zip(
            spaces, points, np.split(matrices, ends), np.split(excess, ends), strict=True
        )
    )
