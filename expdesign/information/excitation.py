"""The excitation condition, and the samples of each equation that meet it.

What stands inside a modulus keeps its sign and exceeds the worst noise and disturbance. Then noisy velocities leave no
bias in the equation that holds the modulus, with instruments without mean. Each equation has moduli of its own: of the
manoeuvring model, surge has |u|, sway and yaw have |v|. A design counts by choice

- "free": every sample in every equation;
- "rewarded": in each equation the samples that meet its condition, which is the information of the estimate from
  equation-wise samples;
- "required": the same, of runs only that meet it from when they first do until they last do, which is at least
  `LEAST_CLEAR` of the run; heading by heading. Manoeuvres begin straight, so an offset takes time to build up.

On either side of zero the mean of a square's noise has another sign, so samples of each side are a stratum with a mean
of its own, as in `estimation.excitation`.

Source: F. Ljungberg, doctoral thesis, Linköping University, 5.6, assumptions A5 and A7, (5.8), (5.72).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from expdesign.information.moments import PrimitiveInformation, signals_of
from expdesign.signals import Commands, Trajectory
from expdesign.simulation import Environment
from expdesign.vessel import NUMPY, Vessel, VesselModel
from expdesign.vessel.structures import Expression, Signals

LEAST_CLEAR = 0.5  # share of a run that meets the excitation condition, at least, where designs require it
FREE, REWARDED, REQUIRED = "free", "rewarded", "required"
EXCITATIONS = (FREE, REWARDED, REQUIRED)
SIGMAS = 3.0
Strata = NDArray[np.int8]
"""(outputs, k, ...) 0 where the condition of an equation does not hold, else from 1 on the sides of its moduli."""


def excitation_condition(
    vessel: Vessel, trajectory: Trajectory, commands: Commands, environment: Environment, *, sigmas: float = SIGMAS
) -> bool:
    """Whether the argument of every modulus keeps its sign and is at least `sigmas` standard deviations from zero.

    The standard deviation includes the sensors' noise and the stated spread of current and wind. Arguments that depend
    on commands only have to keep their sign.
    """
    return bool(whole_runs(strata_of_run(vessel, trajectory, commands, environment, sigmas=sigmas)).all())


def strata_of_run(
    vessel: Vessel,
    trajectory: Trajectory,
    commands: Commands,
    environment: Environment,
    *,
    sigmas: float = SIGMAS,
    air_measured: bool = False,
) -> Strata:
    """(outputs, k) strata of the samples of one run, at every command's start."""
    k = len(commands)
    state = (*trajectory.pose[:k].T, *trajectory.velocity[:k].T)
    table = signals_of(vessel.model, state, commands.values.T, environment)
    return strata(vessel, table, environment, shape=(k,), sigmas=sigmas, air_measured=air_measured)


def strata(
    vessel: Vessel,
    table: Signals,
    environment: Environment,
    *,
    shape: tuple[int, ...],
    sigmas: float = SIGMAS,
    air_measured: bool = False,
) -> Strata:
    """(outputs, k, ...) strata for signals that broadcast to (k, ...).

    Args:
        vessel: model and sensors.
        table: signals of its terms.
        environment: spread of current and wind.
        shape: (k, ...).
        sigmas: standard deviations that count as the worst case.
        air_measured: whether samples are chosen by the measured wind, whose spread then does not matter, as in (5.77).
    """
    model, noise = vessel.model, _signal_noise(vessel, environment, air_measured)
    result = np.ones((len(model.outputs), *shape), dtype=np.int8)
    for modulus, equations in moduli_of(model).values():
        side = _sides(modulus, table, noise, sigmas, shape)
        for equation in equations:
            own = result[model.outputs.index(equation)]
            own[...] = np.where((side == 0) | (own == 0), 0, 2 * own - (side < 0))
    return result


def moduli_of(model: VesselModel) -> dict[str, tuple[Expression, tuple[str, ...]]]:
    """Every modulus, and the equations whose terms hold it."""
    found: dict[str, tuple[Expression, tuple[str, ...]]] = {}
    for term, expression in zip(model.terms, model.expressions, strict=True):
        for modulus in expression.moduli:
            _, equations = found.get(modulus.text, (modulus, ()))
            found[modulus.text] = (modulus, tuple(dict.fromkeys((*equations, term.equation))))
    return found


def most_strata(model: VesselModel) -> list[int]:
    """How many strata each equation may have."""
    held = [equation for _, equations in moduli_of(model).values() for equation in equations]
    return [2 ** held.count(output) for output in model.outputs]


def whole_runs(found: Strata) -> NDArray[np.bool_]:
    """(outputs, ...) whether the condition of an equation holds from begin to end, on the same sides."""
    return np.asarray((found[:, 0] > 0) & (found == found[:, :1]).all(axis=1))


def kept_runs(found: Strata) -> NDArray[np.bool_]:
    """(outputs, ...) whether a run, once clear on some sides, stays so until it last is, for most of its samples."""
    clear = found > 0
    begun = np.maximum.accumulate(clear, axis=1)
    inside = begun & np.maximum.accumulate(clear[:, ::-1], axis=1)[:, ::-1]
    steady = (~inside | (found == found.max(axis=1, keepdims=True))).all(axis=1)
    return np.asarray(steady & (clear.mean(axis=1) >= LEAST_CLEAR))


def excitation_refusal(model: VesselModel, information: Sequence[PrimitiveInformation], excitation: str) -> str:
    """Which manoeuvres do not meet the condition, equation by equation: for a design that lacks information."""
    texts = []
    for output in model.outputs:
        insides = [text for text, (_, equations) in moduli_of(model).items() if output in equations]
        failing = [item.primitive.name for item in information if not item.clear_share.get(output, 1.0)]
        if insides and failing:
            count = "all" if len(failing) == len(information) else f"{len(failing)} of {len(information)}"
            texts.append(f"d{output}/dt needs {' and '.join(insides)}, which {count} lack ({_listed(failing)})")
    why = f": {'; '.join(texts)}" if texts else ", which all do; but they do not determine every parameter"
    whole = ", once clear, to the end of their excitation" if excitation == REQUIRED else ""
    return (
        f"design.excitation is {excitation!r} and needs manoeuvres that keep velocities inside absolute values clear "
        f"of zero{whole}, by {SIGMAS:g} standard deviations of noise and disturbance{why}. Add some with an offset"
    )


def _listed(names: Sequence[str], most: int = 4) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


def _signal_noise(vessel: Vessel, environment: Environment, air_measured: bool) -> dict[str, float]:
    """Standard deviation of each motion signal, from its sensor and from current or wind."""
    sensors = vessel.sensors
    water = math.hypot(sensors.velocity_mps, environment.current_std_mps)
    air = math.hypot(sensors.velocity_mps, sensors.wind_mps, environment.wind_std_mps)
    if air_measured:
        air = sensors.wind_mps
    return {"u": water, "v": water, "r": sensors.yaw_rate_radps, "u_q": air, "v_q": air}


def _sides(
    modulus: Expression, table: Signals, noise: Mapping[str, float], sigmas: float, shape: tuple[int, ...]
) -> NDArray[np.int8]:
    """(k, ...) 1 or -1 where what stands inside is farther from zero than its margin, else 0."""
    inside = np.broadcast_to(np.asarray(modulus.evaluate(table, NUMPY)), shape)
    shifted = (
        modulus.evaluate({**table, name: table[name] + noise[name]}, NUMPY) for name in modulus.signals if name in noise
    )
    margin = sigmas * np.sqrt(sum(((other - inside) ** 2 for other in shifted), np.zeros_like(inside)))
    return np.asarray((inside > margin).astype(np.int8) - (inside < -margin).astype(np.int8), dtype=np.int8)
