"""The scalar second-order modulus system of the reference studies: LS, IV, and zero-mean IV against its truth.

    x(k + 1) = n (x + v)|x + v| + f u + w,   y1 = x + e1,   y2 = v + e2

In the steps case the input varies with a standard deviation of 0.5: the published spreads fit that, and not a variance
of 0.5, under which all four come out a fifth to two fifths smaller.

Numbers: normalised errors (estimate - truth) / |truth|, mean and standard deviation over 500 runs of 5000 samples.

Source: F. Ljungberg, doctoral thesis, Linköping University, (4.35)-(4.43), figures 4.1-4.11; (7.44)-(7.49), figures
7.3 and 7.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from comparison import Comparison, Published, compare
from expdesign.errors import UnknownName
from expdesign.estimation.regression import Regression, single_output
from expdesign.estimation.solve import Weighting, solve_iv, solve_ls
from expdesign.values import Array

TRUTH = np.array([-0.1, 1.0])
NAMES = ("n", "f")
REFINEMENTS = 8  # more do not change the tables: the estimate settles within three or four


@dataclass(frozen=True, kw_only=True)
class Case:
    """One experiment.

    Attributes:
        name: for tables.
        input: "zero-mean", "offset" (4.42) or "steps" (7.47).
        mean_v: mean of the disturbance inside the modulus.
        measured_v: whether y1 + y2 takes the place of y1 (4.43).
        published: estimator -> numbers for n and f.
    """

    name: str
    input: str
    mean_v: float
    measured_v: bool
    published: dict[str, tuple[Published, Published]]


def _figures(*numbers: float) -> tuple[Published, Published]:
    return Published(mean=numbers[0], std=numbers[1]), Published(mean=numbers[2], std=numbers[3])


CASES = (
    Case(
        name="v mean 0, no offset",
        input="zero-mean",
        mean_v=0.0,
        measured_v=False,
        published={
            "LS": _figures(0.0922, 0.0330, 0.0005, 0.0062),
            "IV": _figures(-0.0423, 0.0389, 0.0007, 0.0062),
            "IV complete": _figures(-0.0423, 0.0389, 0.0007, 0.0062),
        },
    ),
    Case(
        name="v mean 0, offset",
        input="offset",
        mean_v=0.0,
        measured_v=False,
        published={
            "LS": _figures(0.2097, 0.0416, 0.0511, 0.0076),
            "IV": _figures(0.0762, 0.0486, 0.0654, 0.0079),
            "IV complete": _figures(-0.0066, 0.0531, 0.0002, 0.0137),
        },
    ),
    Case(
        name="v mean 0.1, offset",
        input="offset",
        mean_v=0.1,
        measured_v=False,
        published={
            "LS": _figures(0.1511, 0.0428, 0.0417, 0.0073),
            "IV": _figures(0.0051, 0.0505, 0.0568, 0.0077),
            "IV complete": _figures(-0.0798, 0.0578, -0.0001, 0.0135),
        },
    ),
    Case(
        name="v mean 0.1, offset, v measured",
        input="offset",
        mean_v=0.1,
        measured_v=True,
        published={
            "LS": _figures(0.2899, 0.0270, 0.0552, 0.0069),
            "IV": _figures(0.1168, 0.0409, 0.0800, 0.0082),
            "IV complete": _figures(0.0122, 0.0486, -0.0003, 0.0133),
        },
    ),
    Case(
        name="steps 1 to 5",
        input="steps",
        mean_v=0.0,
        measured_v=False,
        published={
            "IV batch": _figures(-9.73e-4, 0.0233, -3.54e-4, 0.0162),
            "IV complete": _figures(-2.78e-4, 0.0212, -1.89e-4, 0.0075),
        },
    ),
)
MEANS = {"IV": "none", "IV batch": "batch", "IV complete": "complete"}


def run_case(case: Case, *, runs: int, samples: int, rng: np.random.Generator) -> list[Comparison]:
    """Simulate and estimate one case with every estimator that has published numbers."""
    u, y, regressor = simulate(case, runs=runs, samples=samples, rng=rng)
    batch = np.repeat(np.arange(5), samples // 5) if case.input == "steps" else np.zeros(samples, dtype=np.int64)
    data = [
        single_output(_columns(regressor[:, run], u[:, run]), y[:, run], parameters=NAMES, batch=batch)
        for run in range(runs)
    ]
    start = np.array([solve_ls(item, Weighting(covariance="hc0")).values for item in data])
    result = []
    for name, published in case.published.items():
        values = start if name == "LS" else refined(data, start, u, MEANS[name])
        errors = (values - TRUTH) / np.abs(TRUTH)
        result += [
            compare(case.name, f"{name} {parameter}", errors[:, index], published[index])
            for index, parameter in enumerate(NAMES)
        ]
    return result


def simulate(case: Case, *, runs: int, samples: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Input u(k - 1), output y1(k) and the measured signal inside the modulus at k - 1, each (samples, runs)."""
    u = draw_input(case.input, samples, runs, rng)
    w = 0.1 + np.sqrt(0.1) * rng.standard_normal(u.shape)
    v = case.mean_v + 0.5 * rng.standard_normal(u.shape)
    x = np.zeros((samples + 1, runs))
    for k in range(samples):
        inside = x[k] + v[k]
        x[k + 1] = TRUTH[0] * inside * np.abs(inside) + TRUTH[1] * u[k] + w[k]
    y = x + np.sqrt(0.1) * rng.standard_normal(x.shape)
    seen = y[:-1] + (v + np.sqrt(0.1) * rng.standard_normal(v.shape) if case.measured_v else 0.0)
    return u, y[1:], seen


def draw_input(kind: str, samples: int, runs: int, rng: np.random.Generator) -> Array:
    """(samples, runs) inputs of a kind.

    Raises:
        UnknownName: no such kind.
    """
    drawn = rng.standard_normal((samples, runs))
    match kind:
        case "zero-mean":
            return drawn
        case "offset":
            return np.maximum(np.abs(drawn), 0.6)
        case "steps":
            return np.asarray(0.5 * drawn + np.repeat(np.arange(1.0, 6.0), samples // 5)[:, None])
    raise UnknownName("input", kind, known=("zero-mean", "offset", "steps"))


def refined(data: list[Regression], start: Array, u: Array, mean: str) -> Array:
    """(runs, 2) refined IV estimates; instruments of all runs are simulated side by side."""
    weighting, values = Weighting(mean=mean, covariance="hc0"), start
    for _ in range(REFINEMENTS):
        x = np.zeros_like(u)
        for k in range(len(u) - 1):
            x[k + 1] = values[:, 0] * x[k] * np.abs(x[k]) + values[:, 1] * u[k]
        values = np.array(
            [
                solve_iv(item, _columns(x[:, run], u[:, run])[:, None, :], weighting).values
                for run, item in enumerate(data)
            ]
        )
    return values


def _columns(inside: Array, u: Array) -> Array:
    return np.stack([inside * np.abs(inside), u], axis=1)
