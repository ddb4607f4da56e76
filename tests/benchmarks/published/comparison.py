"""Our Monte Carlo numbers beside published ones, judged by the chance error of both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class Published:
    """Mean and standard deviation over so many runs.

    Attributes:
        mean, std: of the normalised error.
        runs: number of runs.
    """

    mean: float
    std: float
    runs: int = 500


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One number of ours beside a published one.

    Attributes:
        case: which study.
        name: which quantity.
        mean, std, runs: ours.
        published: theirs.
    """

    case: str
    name: str
    mean: float
    std: float
    runs: int
    published: Published

    @property
    def mean_score(self) -> float:
        """Difference of the means in standard errors of that difference."""
        error = np.hypot(self.std / np.sqrt(self.runs), self.published.std / np.sqrt(self.published.runs))
        return float((self.mean - self.published.mean) / error)

    @property
    def std_score(self) -> float:
        """Difference of the log standard deviations in standard errors of that difference."""
        error = np.sqrt(0.5 / (self.runs - 1) + 0.5 / (self.published.runs - 1))
        return float(np.log(self.std / self.published.std) / error)


def compare(case: str, name: str, errors: Array, published: Published) -> Comparison:
    """A comparison from errors of our runs (r,)."""
    return Comparison(
        case=case,
        name=name,
        mean=float(errors.mean()),
        std=float(errors.std(ddof=1)),
        runs=len(errors),
        published=published,
    )
