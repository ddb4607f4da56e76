"""Search for the candidate of largest sensitivity: a quasi-random pool, then local random steps from the best ones.

A candidate's matrix does not depend on the design, so every simulated candidate is kept and its sensitivity for a new
design costs one product. No evaluated candidate has a larger sensitivity than reported. This is not a bound over all
members of the families.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.dictionary import PrimitiveSpec
from expdesign.dictionary.batch import excite_many
from expdesign.growing.space import FamilySpace
from expdesign.growing.tuning import TUNING
from expdesign.information.many import bordered_runs
from expdesign.progress import Progress, silent
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel


@dataclass(frozen=True, kw_only=True, eq=False)
class Measure:
    """Information matrix and limit violation of a specification.

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
        """Matrices B (n, d, d) and violations (n,), which are infinite for impossible runs."""
        pieces = [self._some(specs[first : first + TUNING.batch]) for first in range(0, len(specs), TUNING.batch)]
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
    """All evaluated candidates of one family.

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
        return np.where(self.excess <= TUNING.limit_rounding, d, -self.excess)

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
    from scipy.stats import qmc  # slow to import

    points = []
    for number, space in enumerate(spaces):
        count = max(TUNING.fewest_closed_loop, pool // TUNING.closed_loop_share) if space.family.closed_loop else pool
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
    for generation, stride in enumerate(TUNING.strides):
        progress("searching for runs that add more information", generation / len(TUNING.strides))
        points = [_steps(archive, inverse, stride, rng) for archive in grown]
        more = _measured(spaces, points, measure)
        grown = tuple(archive.with_more(other) for archive, other in zip(grown, more, strict=True))
    return grown


def best_of(archives: Sequence[Archive], inverse: Array) -> tuple[PrimitiveSpec | None, float]:
    """The candidate of largest sensitivity within limits, and that; None and -inf where there is none."""
    merits = [archive.merits(inverse) for archive in archives]
    winner = int(np.argmax([values.max() for values in merits]))
    place, archive = int(np.argmax(merits[winner])), archives[winner]
    if archive.excess[place] > TUNING.limit_rounding:
        return None, -np.inf
    return archive.space.spec(archive.points[place]), float(merits[winner][place])


def _steps(archive: Archive, inverse: Array, stride: float, rng: np.random.Generator) -> Array:
    """(n, a) points near the family's best ones."""
    if archive.space.family.closed_loop:
        return archive.points[:0]
    order = np.argsort(-archive.merits(inverse), kind="stable")[: TUNING.leaders]
    parents = np.repeat(archive.points[order], TUNING.offspring, axis=0)
    steps = stride * rng.standard_normal(parents.shape)
    moved = rng.random(parents.shape) < max(0.4, 1.0 / parents.shape[1])
    for index, axis in enumerate(archive.space.axes):
        if axis.scale == "whole":
            redrawn = rng.random(len(parents)) < TUNING.redrawn
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
