"""Runs at one load each, and their preparation: low-pass filter, fewer samples, differences."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.values import Array, seal
from expdesign.vessel.masses import Load


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One uninterrupted record.

    Attributes:
        step_s: time between samples [s].
        signals: (k, 4) roll rate [rad/s], positive to starboard; reading of the accelerometer to port, gravity in it
            [m/s2]; yaw rate [rad/s], positive to starboard; rudder, of any sign and unit.
        planned: (k,) what the rudder was planned to be, whatever the ship did; None where it was set beforehand itself.
        unwarped: share of half the sample rate, below which the bilinear map of the equation is made exact.
    """

    step_s: float
    signals: Array
    planned: Array | None = None
    unwarped: float = 0.0

    def __post_init__(self) -> None:
        seal(self, signals="k 4", **({} if self.planned is None else {"planned": "k"}))

    @property
    def source(self) -> Array:
        """(k,) signal that moves the rudder and does not depend on the ship's motion: instruments come from it."""
        return self.signals[:, 3] if self.planned is None else self.planned


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """Runs at one load.

    Attributes:
        name: for reports.
        load: on board; None for the unknown one.
        runs: at least one, all with one time between samples.
    """

    name: str
    load: Load | None
    runs: tuple[Run, ...]
