"""Options of an estimation."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.assessment.prior import NONE, PARAMETER_STD, PRIORS
from expdesign.errors import InputError, UnknownName
from expdesign.estimation.equation_wise import ALL, SAMPLES
from expdesign.estimation.regression import MEANS
from expdesign.estimation.replay import STEERED, Integration
from expdesign.estimation.settings import STARTS
from expdesign.estimation.solve import BLOCKS
from expdesign.simulation.run import SUBSTEPS

AUTO = "auto"
CONTINUOUS, EULER = "continuous", "euler"
MOTIONS = (CONTINUOUS, EULER)
HELD_OUT, INSTRUMENTS = "held-out", "instruments"
CHOICES = (HELD_OUT, INSTRUMENTS)


@dataclass(frozen=True, kw_only=True)
class EstimateOptions:
    """Options of an estimation.

    Attributes:
        methods: names in `estimation.methods.METHODS`; empty for those that suit the data.
        fixed: parameters held at the vessel's values.
        mean: subtracted from the instruments: "none", "batch" or "complete".
        blocks: of instruments: "one" for all runs, or one for each "batch" (4.45).
        start: of the first instruments: "nominal" for the vessel's values, "ls" for the least-squares estimate, "auto"
            for the vessel's values unless they are all zero or fail.
        motion: "continuous" for parameters of the continuous-time motion, which plans use; "euler" for those of Euler's
            map at the sample time.
        horizon_s: simulation horizon of output error [s], None for whole runs.
        constant: whether output error gives every run a constant force of its own.
        steered: what becomes of samples marked as steered, one of `estimation.replay.STEERED`.
        samples: "all", or "equation-wise": for each equation those that meet the excitation condition.
        offset_mps: strongest current, and wind where it is not measured, that velocities inside an absolute value must
            exceed in equation-wise samples, beside the sensors' noise [m/s].
        prior: "parameter_std" to join estimates with what the vessel file knew before, or "none".
        choice: of the best estimate: "held-out" for that which predicts best, see `held_out`; "instruments" for the
            first stable one with instruments, and without output error unless that is among the methods.
    """

    methods: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    mean: str = "complete"
    blocks: str = "one"
    start: str = AUTO
    motion: str = CONTINUOUS
    horizon_s: float | None = None
    constant: bool = False
    steered: str = AUTO
    samples: str = ALL
    offset_mps: float = 0.0
    prior: str = NONE
    choice: str = HELD_OUT

    def __post_init__(self) -> None:
        for what, value, known in (
            ("instrument mean", self.mean, MEANS),
            ("instrument blocks", self.blocks, BLOCKS),
            ("start", self.start, (AUTO, *STARTS)),
            ("motion", self.motion, MOTIONS),
            ("treatment of steered samples", self.steered, STEERED),
            ("choice of samples", self.samples, SAMPLES),
            ("prior", self.prior, PRIORS),
            ("choice", self.choice, CHOICES),
        ):
            if value not in known:
                raise UnknownName(what, value, known=known)
        if self.prior == PARAMETER_STD and self.motion != CONTINUOUS:
            raise InputError(
                f"--prior {PARAMETER_STD} is of the continuous motion, expected it without --motion {EULER}"
            )
        if not 0 <= self.offset_mps < float("inf"):
            raise InputError(f"offset is {self.offset_mps:g} m/s, expected 0 or more")
        if self.horizon_s is not None and not 0 < self.horizon_s < float("inf"):
            raise InputError(f"horizon is {self.horizon_s:g} s, expected more than 0")

    @property
    def integration(self) -> Integration:
        """Integrator of the models."""
        return Integration("rk4", SUBSTEPS) if self.motion == CONTINUOUS else Integration()

    @property
    def quadrature(self) -> str:
        """Quadrature of the regressors over a sample interval."""
        return "trapezoid" if self.motion == CONTINUOUS else "euler"
