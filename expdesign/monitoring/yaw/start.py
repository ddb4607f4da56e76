"""First values of a yaw model from data alone: least squares of its equation, integrated over seconds."""

from __future__ import annotations

import numpy as np

from expdesign.monitoring.yaw.model import YawData, YawModel
from expdesign.values import Array

INTERVAL_S = 5.0
"""Over which the equation is integrated [s]."""
LEAST_SHARE = 1e-3
"""Of the moment, that a parameter of the wrong sign gives at first."""


def start_values(model: YawModel, data: YawData) -> dict[str, float]:
    """A value of every parameter, none of them zero, from all voyages together.

    I_r (r(t + T) - r(t)) - sum of parameters times integrals of their terms = integral of the moment is linear in all
    parameters. Noise of the inputs biases them; they are where `estimate_yaw` begins.
    """
    width = max(1, round(INTERVAL_S / data.sample_time_s))
    edges = np.arange(0, data.r.shape[1] - width, width)
    terms = np.moveaxis(model.terms(data), -1, 0)

    def over(values: Array) -> Array:
        summed = np.cumsum(values, axis=1) * data.sample_time_s
        return np.asarray((summed[:, edges + width] - summed[:, edges]).reshape(-1))

    half = max(1, width // 4)
    level = np.stack([data.r[:, edges + shift] for shift in range(half)]).mean(axis=0)
    later = np.stack([data.r[:, edges + width - shift] for shift in range(half)]).mean(axis=0)
    turned = width / max(width - half + 1, 1) * (later - level).reshape(-1)
    columns = np.column_stack([turned, *(-over(term) for term in terms)])
    moment = over(data.moment)
    size = np.sqrt((columns**2).mean(axis=0))
    size = np.where(size > 0, size, 1.0)
    found = np.linalg.lstsq(columns / size, moment, rcond=1e-8)[0]
    least = LEAST_SHARE * float(np.sqrt((moment**2).mean()))
    signs = np.array([1.0 if name == "I_r" else -1.0 if name in model.damping else 0.0 for name in model.parameters])
    wrong = (signs * found < 0) | (np.abs(found) < least)
    found = np.where(wrong, np.where(signs == 0.0, -1.0, signs) * max(least, 1e-300), found) / size
    return dict(zip(model.parameters, found.tolist(), strict=True))
