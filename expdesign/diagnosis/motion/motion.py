"""A simulation of all windows, and its linearisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.model import ExtendedModel
from expdesign.diagnosis.motion.exogenous_inputs import ExogenousInputs
from expdesign.diagnosis.motion.tuning import TUNING
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A simulation of all windows.

    Attributes:
        ship: the simulated model.
        windows: the data it is compared with.
        exogenous: exogenous signals.
        states: (w, k, n) at integrator steps.
        heading_change: (w, k) heading since the start [rad].
        predicted: (w, s, 4) sensor outputs.
    """

    ship: ExtendedModel
    windows: Windows
    exogenous: ExogenousInputs
    states: Array
    heading_change: Array
    predicted: Array

    @cached_property
    def ends(self) -> Array:
        """(2, w, k - 1, n) states at the beginning and at the end of every step; components lie apart in memory."""
        components = np.moveaxis(self.states, -1, 0)
        return np.moveaxis(np.stack([components[..., :-1], components[..., 1:]], axis=1), 0, -1)

    @property
    def error(self) -> Array:
        """(w, s, 4) measured less simulated, nan where not measured."""
        return np.asarray(self.windows.measured - self.predicted)

    @property
    def diverged(self) -> bool:
        """Whether a speed exceeds `Tuning.largest_speed`."""
        return bool(self.diverged_windows.any())

    @property
    def diverged_windows(self) -> NDArray[np.bool_]:
        """(w,) in which windows it does."""
        return np.asarray(~(np.abs(self.states).max(axis=(1, 2)) < TUNING.largest_speed))


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearisedMotion:
    """The linearised motion along a simulation.

    Attributes:
        motion: the simulation.
        transition: (w, k - 1, n, n) transition over each step.
        forcing: (w, k - 1, n, n) effect of a constant acceleration over each step.
        path_rates: (2, w, k - 1, n) rates along the path at both ends of every step, with its inputs.
    """

    motion: Motion
    transition: Array
    forcing: Array
    path_rates: Array

    @cached_property
    def mean_rates(self) -> Array:
        """(w, k - 1, n) means of the rates at both ends."""
        return np.asarray(self.path_rates.mean(axis=0))

    def selected(self, keep: NDArray[np.bool_]) -> LinearisedMotion:
        """Only some of the windows, by a mask (w,)."""
        motion = replace(
            self.motion,
            windows=self.motion.windows.selected(keep),
            exogenous=ExogenousInputs({name: values[keep] for name, values in self.motion.exogenous.items()}),
            states=self.motion.states[keep],
            heading_change=self.motion.heading_change[keep],
            predicted=self.motion.predicted[keep],
        )
        return LinearisedMotion(
            motion=motion,
            transition=self.transition[keep],
            forcing=self.forcing[keep],
            path_rates=self.path_rates[:, keep],
        )
