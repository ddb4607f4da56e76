"""One run, simulated with an estimated model from its first measured state and compared with the measurement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.conventions import OUTPUTS
from expdesign.errors import Diverged
from expdesign.estimation.fit import fit_percent
from expdesign.estimation.replay import Integration, instrument_wind, simulate_batch
from expdesign.signals import Batch
from expdesign.values import Array, seal
from expdesign.vessel import VesselModel

ESTIMATION, TEST = "estimation", "test"


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCheck:
    """The simulation of one run and its errors.

    Attributes:
        batch: the run.
        use: "estimation" or "test".
        outputs: the velocities that have an equation.
        fit_percent: (n,) of the simulated output, nan where the measured one is constant or the simulation diverges.
        rmse: (n,) root-mean-square error [m/s, rad/s], nan likewise.
        simulated: (k, 3) u, v, r; None when the simulation diverges.
        problem: why there is no simulation, or "".
    """

    batch: Batch
    use: str
    outputs: tuple[str, ...]
    fit_percent: Array
    rmse: Array
    simulated: Array | None
    problem: str

    def __post_init__(self) -> None:
        seal(self, fit_percent="n", rmse="n", **({} if self.simulated is None else {"simulated": "k 3"}))


EULER = Integration()


def check_run(model: VesselModel, batch: Batch, *, use: str, wind: bool, integration: Integration = EULER) -> RunCheck:
    """Simulate a run and compare.

    Args:
        model: with estimated parameters.
        batch: the run.
        use: "estimation" or "test".
        wind: simulate in the wind that was measured; otherwise in still air. The water is still in both.
        integration: Euler's map at the sample time when left out.
    """
    try:
        simulated, problem = _simulated(model, batch, wind=wind, integration=integration), ""
    except Diverged as error:
        simulated, problem = None, str(error)
    columns = [OUTPUTS.index(name) for name in model.outputs]
    fit = rmse = np.full(len(columns), np.nan)
    if simulated is not None:
        measured, compared = batch.velocity[:, columns], simulated[:, columns]
        fit = fit_percent(measured, compared)
        rmse = np.sqrt(np.nanmean((measured - compared) ** 2, axis=0))
    return RunCheck(
        batch=batch, use=use, outputs=model.outputs, fit_percent=fit, rmse=rmse, simulated=simulated, problem=problem
    )


def _simulated(model: VesselModel, batch: Batch, *, wind: bool, integration: Integration) -> Array:
    """(k, 3); in wind that is the n-frame one which anemometer, velocity and heading give at each sample."""
    air = instrument_wind(batch, "lagged").T if wind else None
    return simulate_batch(model, batch, integration=integration, wind_to=air).velocity
