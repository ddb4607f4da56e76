"""The duration problem and its certified answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.values import Array, seal


@dataclass(frozen=True, kw_only=True, eq=False)
class DurationProblem:
    """Maximise log det B(w), B(w) = sum_q w_q B_q, over time fractions w.

    With complete mean subtraction B_q = [[X_q, Y_q], [Z_q^T, I]], of dimension p + n: log det B(w) is then the log
    det of the information matrix after subtraction, because sum w = 1. Otherwise B_q has dimension p.

    Attributes:
        names: of the primitives.
        parameters: names of the p parameters.
        mean_subtraction: "none", "batch" or "complete".
        matrices: (q, d, d) B_q in physical parameter scale.
        run_s: (q,) duration of one whole run of each primitive [s].
        total_s: time to share out [s].

    Source: F. Ljungberg, doctoral thesis, Linköping University, (7.50)-(7.57); Schur complement form derived here.
    """

    names: tuple[str, ...]
    parameters: tuple[str, ...]
    mean_subtraction: str
    matrices: Array
    run_s: Array
    total_s: float

    def __post_init__(self) -> None:
        seal(self, matrices="q d d", run_s="q")

    @property
    def dimension(self) -> int:
        """Size d of B: parameters, and means when they are subtracted over the complete data."""
        return int(self.matrices.shape[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class DurationDesign:
    """How long to run each primitive, with the proof.

    Attributes:
        problem: what was asked.
        fractions: (q,) optimal time fractions, sum 1.
        sensitivities: (q,) d_q = trace(B(w)^-1 B_q); at the optimum at most `dimension`, equal where w_q > 0.
        log_det: log det B at `fractions`.
        gap: max d_q - dimension: no design has a log det above log_det + gap (Kiefer and Wolfowitz 1960).
        repeats: (q,) whole runs.
        efficiency_repeats: D-efficiency of the whole runs against the optimum, by determinant to the power 1/p.
        efficiency_uniform: the same for equal time on every primitive.
    """

    problem: DurationProblem
    fractions: Array
    sensitivities: Array
    log_det: float
    gap: float
    repeats: tuple[int, ...]
    efficiency_repeats: float
    efficiency_uniform: float

    def __post_init__(self) -> None:
        seal(self, fractions="q", sensitivities="q")

    @property
    def log_det_bound(self) -> float:
        """Upper bound on the log det of any design."""
        return self.log_det + self.gap

    @property
    def gap_relative(self) -> float:
        """The gap relative to the dimension."""
        return self.gap / self.problem.dimension

    @property
    def durations_s(self) -> Array:
        """(q,) time of each primitive before rounding [s]."""
        return np.asarray(self.fractions * self.problem.total_s)
