"""Choices of an estimate that most users leave alone."""

from __future__ import annotations

from dataclasses import dataclass, field

from expdesign.errors import UnknownName
from expdesign.estimation.equation_wise import ALL, SAMPLES
from expdesign.estimation.excitation import WorstCase
from expdesign.estimation.output_error import ActuatorTime, Begun
from expdesign.estimation.replay import STEERED, Integration
from expdesign.estimation.solve import Weighting
from expdesign.estimation.tuning import TUNING
from expdesign.vessel import Sensors

STARTS = ("nominal", "ls")
"""Models that first instruments may come from: the one in use, or that of least squares."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Choices of an estimate.

    Attributes:
        fixed: parameters held at the model's values.
        weighting: how IV equations are formed; least squares subtracts no mean and uses one block.
        start: first instruments from the "nominal" model or from the "ls" estimate.
        most_refinements: 0 for instruments of the first model only.
        heading: of the instruments, "measured" or "simulated".
        wind: of the instruments, "lagged", "mean" or "measured".
        integration: how models are simulated, for instruments and for output error.
        horizon_s: of output error [s], None for whole runs.
        constant: whether output error gives each run a constant acceleration of its own.
        quadrature: of regressors and instruments over a sample interval, "euler" or "trapezoid".
        steered: what becomes of samples marked as steered: "use", "leave-out", "planned" for instruments from the
            inputs as planned, or "auto", see `replay.treatment_of`.
        samples: "all", or "equation-wise", see `equation_wise`; output error uses all.
        worst: what signals inside a modulus must exceed in equation-wise samples.
        times: dead times and lags that output error estimates beside the parameters.
        sensors: whose noise leaves the first velocities of output error uncertain.
        begun: where output error goes on; None to begin with least squares.
    """

    fixed: tuple[str, ...] = ()
    weighting: Weighting = field(default_factory=lambda: Weighting(mean="complete"))
    start: str = "nominal"
    most_refinements: int = TUNING.most_refinements
    heading: str = "measured"
    wind: str = "lagged"
    integration: Integration = field(default_factory=Integration)
    horizon_s: float | None = None
    constant: bool = False
    quadrature: str = "euler"
    steered: str = "auto"
    samples: str = ALL
    worst: WorstCase = field(default_factory=WorstCase)
    times: tuple[ActuatorTime, ...] = ()
    sensors: Sensors = field(default_factory=Sensors)
    begun: Begun | None = None

    def __post_init__(self) -> None:
        if self.steered not in STEERED:
            raise UnknownName("treatment of steered samples", self.steered, known=STEERED)
        if self.samples not in SAMPLES:
            raise UnknownName("choice of samples", self.samples, known=SAMPLES)
        if self.start not in STARTS:
            raise UnknownName("start of instruments", self.start, known=STARTS)
