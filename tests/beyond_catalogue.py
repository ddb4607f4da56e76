"""Trials with effects that no cause of the catalogue is, and the model that knows nothing of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import hidden_effects as sea
from diagnosis_case import vessel_of
from expdesign.signals import Batch, Record
from expdesign.vessel import Vessel

RUNS, SAMPLES = 8, 300
STUCK_S, VENTILATED_RPS, DRIFT = 1200.0, 8.0, 1.5e-3
Alter = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Orders (b, k, m) that reach the ship, of those recorded and the speed ahead (b, k) that they lead to."""


def trial(
    ship: str, seed: int, *, effects: dict[str, float] | None = None, alter: Alter | None = None, drift: float = 0.0,
    runs: int = RUNS, samples: int = SAMPLES,
) -> tuple[Vessel, Record]:  # fmt: skip
    """A model with the generator's own parameters, and 40 minutes of helmsman's orders."""
    orders = sea.commands(ship, runs, samples, 1.0, np.random.default_rng(seed))

    def sailed(given: np.ndarray) -> dict[str, np.ndarray]:
        one = sea.Trial(ship=ship, effects=effects or {}, parameters=dict(sea.SHIPS[ship]))
        return sea.sail([one], given[None], 1.0, sea.Weather(), np.random.default_rng(seed + 1))

    true = sailed(orders)
    if alter is not None:
        true = sailed(alter(orders, true["u"][0]))
    told = sea.measure(true, 1.0, sea.Sensors(), np.random.default_rng(seed + 2), [{}])

    def shown(number: int, *names: str) -> np.ndarray:
        columns = np.column_stack([told[name][0, number] for name in names])
        time = np.arange(samples, dtype=float)
        late = time - drift * (time + number * samples)
        return np.column_stack([np.interp(late, time, column) for column in columns.T]) if drift else columns

    batches = tuple(
        Batch(
            name=f"trial, batch {number}", sample_time_s=1.0, input_names=sea.INPUTS[ship], inputs=orders[number],
            velocity=shown(number, "u_mps", "v_mps", "r_radps"),
            pose=shown(number, "north_m", "east_m", "heading_rad"),
            wind=shown(number, "wind_u_mps", "wind_v_mps"),
        )
        for number in range(runs)
    )  # fmt: skip
    return vessel_of(ship), Record(batches=batches)


def stuck(orders: np.ndarray, _speed: np.ndarray) -> np.ndarray:
    """The first azimuth stays where it is at the time."""
    laid = orders.reshape(-1, orders.shape[-1]).copy()
    laid[int(STUCK_S) :, 1] = laid[int(STUCK_S) - 1, 1]
    return laid.reshape(orders.shape)


def ventilated(orders: np.ndarray, _speed: np.ndarray) -> np.ndarray:
    """Of both propellers, what is ordered above a speed counts for a fifth."""
    changed = orders.copy()
    fast = changed[..., [0, 2]]
    changed[..., [0, 2]] = np.minimum(fast, VENTILATED_RPS) + 0.2 * np.maximum(fast - VENTILATED_RPS, 0.0)
    return changed


def played(orders: np.ndarray, _speed: np.ndarray, width: float = 1.2) -> np.ndarray:
    """A governor that follows its order only once that has turned round by more than its play (backlash)."""
    changed = orders.copy()
    for step in range(1, orders.shape[1]):
        for column in (0, 2):
            order, before = orders[:, step, column], changed[:, step - 1, column]
            changed[:, step, column] = np.clip(before, order - width / 2, order + width / 2)
    return changed


def slower_at_low_speed(orders: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Rudder that lags by 12 s at rest, by 3 s at speed."""
    changed = orders.copy()
    lag = np.clip(12.0 - 3.0 * speed, 1.0, 12.0)
    for step in range(1, orders.shape[1]):
        share = 1.0 - np.exp(-1.0 / lag[:, step])
        changed[:, step, 1] = changed[:, step - 1, 1] + share * (orders[:, step, 1] - changed[:, step - 1, 1])
    return changed


CASES: dict[str, Callable[[int], tuple[Vessel, Record]]] = {
    "cubic damping": lambda seed: trial("barge", seed, effects={"Y_vvv": -0.4, "N_rrr": -60.0}),
    "governor hysteresis": lambda seed: trial("tug", seed, alter=played),
    "propeller ventilation": lambda seed: trial("tug", seed, alter=ventilated),
    "stuck thruster": lambda seed: trial("tug", seed, alter=stuck),
    "speed-dependent lag": lambda seed: trial("coaster", seed, alter=slower_at_low_speed),
    "bank": lambda seed: trial("barge", seed, effects={"bank_sway": 0.02, "bank_yaw": -0.0015}),
    "drifting time stamps": lambda seed: trial("barge", seed, drift=DRIFT),
    "nothing": lambda seed: trial("barge", seed),
}
"""Name -> model in use and data, by seed."""
SAYS: dict[str, tuple[str, ...]] = {
    "cubic damping": ("the term Y_vvv", "the term N_rrr"),
    "governor hysteresis": ("play (hysteresis) of n",),
    "propeller ventilation": ("less effect of n above",),
    "stuck thruster": ("a1 stuck",),
    "speed-dependent lag": ("lag of rudder that changes with speed",),
    "bank": ("a steady force in sway", "a steady moment in yaw"),
    "drifting time stamps": ("time stamps of the sensors that drift",),
    "nothing": ("no error of the model",),
}
"""Words of a verdict that say what is hidden; any of them is right."""
