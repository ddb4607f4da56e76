"""Tables of the step method beside ours: ratio test in correlated noise, dead times, poles, and one outlier of six.

    python tests/benchmarks/published/step_method.py

Takes seconds. Surfaces, validation and data of the trial were published as pictures only and cannot be compared.
"""

from __future__ import annotations

import numpy as np
import scipy

from expdesign.step_trials.responses import Transient, first_order, fit_first_order, second_order
from expdesign.step_trials.samples import modified_scores

PER_S = (0.1, 0.5, 1.0)  # l1, l2, l3 over the time between samples, of the speed over ground in the published trial
CORRELATIONS_S = (0.0, 0.5, 2.0, 10.0)
RATIOS = {
    0.01: (1, 45, 134, 490),
    0.02: (1, 21, 62, 139),
    0.05: (1, 10, 26, 54),
    0.1: (1, 5, 15, 29),
    1.0: (1.3, 1.6, 2.8, 7.7),
}
LENGTH_S = 4000.0


def median_ratio(sample_time_s: float, correlation_s: float, rng: np.random.Generator) -> float:
    """Median steady R of first-order autoregressive noise."""
    keep = np.exp(-sample_time_s / correlation_s) if correlation_s else 0.0
    values = scipy.signal.lfilter([1.0], [1.0, -keep], rng.standard_normal(round(LENGTH_S / sample_time_s)))
    l1, l2, l3 = (min(1.0, rate * sample_time_s) for rate in PER_S)
    mean = scipy.signal.lfilter([l1], [1.0, l1 - 1.0], values)
    spread = scipy.signal.lfilter([l2], [1.0, l2 - 1.0], (values[1:] - mean[:-1]) ** 2)
    jitter = scipy.signal.lfilter([l3], [1.0, l3 - 1.0], np.diff(values) ** 2)
    return float(np.median(((2 - l1) * spread / np.maximum(jitter, 1e-12))[len(values) // 10 :]))


def fitted_ratio(values: np.ndarray, time_s: np.ndarray, true_s: float) -> float:
    """Time constant of a first order response without dead time, over the true one."""
    data = Transient(time_s=time_s, values=values, before=0.0, after=1.0)
    return fit_first_order(data, delay_s=(0.0, 0.0)).time_constant_s / true_s


def main() -> None:
    """Print all tables as published | ours."""
    rng = np.random.default_rng(1)
    print("median R in steady state, sample time by correlation time 0, 0.5, 2, 10 s")
    for sample_time_s, published in RATIOS.items():
        ours = [median_ratio(sample_time_s, correlation_s, rng) for correlation_s in CORRELATIONS_S]
        print(f"{sample_time_s:5.2f} s: " + ", ".join(f"{a:g} | {b:.2g}" for a, b in zip(published, ours, strict=True)))
    print("inertia over the true one, dead time of 0.5 s not modelled")
    for constant_s, published_ratio in ((1.0, 1.52), (2.0, 1.26), (4.0, 1.13), (8.0, 1.06)):
        time_s = np.arange(0.0, 8 * constant_s, 0.02)
        ours_ratio = fitted_ratio(first_order(np.array([constant_s, 0.5]), time_s), time_s, constant_s)
        print(f"T = {constant_s:g} s: {published_ratio} | {ours_ratio:.2f}")
    print("inertia of a first order fit to two poles, over the true one")
    for damping, published_ratio in ((1.0, 1.03), (0.7, 1.09), (0.5, 1.22), (0.3, 1.60)):
        time_s = np.arange(0.0, 25.0, 0.02)
        ours_ratio = fitted_ratio(second_order(np.array([1.0, damping, 0.0, 0.0]), time_s), time_s, 2 * damping)
        print(f"zeta = {damping}: {published_ratio} | {ours_ratio:.2f}")
    values = np.log([40.0, 20.0, 20.5, 19.5, 21.0, 19.0])
    standard = (values - values.mean()) / values.std(ddof=1)
    print(
        f"inertia 40 among five of about 20: standard score at most 2.04 | {standard[0]:.2f} (1.97 published, of 12),"
    )
    print(f"by median and MAD, found from 3.5 on | {modified_scores(values)[0]:.0f}")


if __name__ == "__main__":
    main()
