"""Stretches of data that are to be simulated side by side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from expdesign.estimation.regression import Integers
from expdesign.simulation import euler_step, rk4_step
from expdesign.values import Array, frozen_set
from expdesign.vessel import VesselModel

INTEGRATORS = {"euler": euler_step, "rk4": rk4_step}
Called = Callable[..., tuple[Array, ...]]
"""A compiled function of arrays."""
Simulate = Callable[[Array, Array, Array], Array]
"""(parameters (p,), start state (6 or 8,), inputs (k, m)) -> states (k, 6 or 8); calm water."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretches:
    """W stretches of data of L samples each, simulated side by side; the shorter ones are filled up and not compared.

    Attributes:
        model: structure; gives the values of parameters not sought.
        sought: (p,) places of the parameters to find, among the model's.
        states: (n,) places of the velocities that have an equation, among u, v, r.
        drive: (L, W, c) inputs as of `drive_of` with these times; two columns more, the wind's velocity in the b-frame,
            where `windy`; two more, cosine and sine of the heading, where `flowing`.
        windy: whether air velocities are those of that wind.
        flowing: whether a steady current to north and east [m/s] is sought too, after the parameters.
        sample_time_s: of all stretches.
        integrator, substeps: how the model is integrated.
        parts: of a sample, with inputs of their own.
        times: (u,) names of uncertain times of actuators, whose changes [s] are sought too, last.
        counts: (W,) samples of each stretch; L for all when left out.
    """

    model: VesselModel
    sought: tuple[int, ...]
    states: tuple[int, ...]
    drive: Array
    windy: bool
    sample_time_s: float
    integrator: str
    substeps: int
    parts: int = 1
    flowing: bool = False
    times: tuple[str, ...] = ()
    counts: Integers = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        length, count = self.drive.shape[:2]
        if len(self.counts) != count:
            frozen_set(self, "counts", np.full(count, length))

    @property
    def values(self) -> int:
        """Number of values sought: parameters, a current's two, and changes of times."""
        return len(self.sought) + 2 * self.flowing + len(self.times)
