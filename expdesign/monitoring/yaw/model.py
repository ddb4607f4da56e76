"""Yaw models: the fourth row of the ship's equations, with what cannot be told apart put together.

    I_r dr/dt = -M_v dv/dt + A u r + N_rr r|r| + N_rv r|v| + N_phiur phi u|r|
                + N_uv |u|v + N_phiuv phi|uv| + N_phiuu phi u|u| + tau

I_r is inertia with added inertia, M_v the coupling to sway, A holds damping |u|r and the Coriolis moment, which are one
where u >= 0; the model named separate has both, for voyages that go ahead and astern. The simplified model leaves out
roll and the sway acceleration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError, NotInformative
from expdesign.estimation.regression import model_for
from expdesign.reduction import with_delivered_inputs
from expdesign.signals import AUXILIARY, Batch, Record
from expdesign.values import Array, seal
from expdesign.vessel import NUMPY, VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS

INPUTS = ("sway_acceleration", "u", "v", "phi", "moment")


@dataclass(frozen=True, kw_only=True, eq=False)
class YawData:
    """Measured signals of n voyages, (n, k) each."""

    sample_time_s: float  # time between samples [s]
    r: Array  # yaw rate [rad/s]
    sway_acceleration: Array  # dv/dt [m/s2]
    # u, v: surge and sway speed [m/s]
    u: Array
    v: Array
    phi: Array  # roll [rad]
    moment: Array  # yaw moment of the drives [Nm]

    def __post_init__(self) -> None:
        seal(self, **dict.fromkeys(("r", *INPUTS), "n k"))

    def part(self, samples: slice) -> YawData:
        """Consecutive samples."""
        return YawData(
            sample_time_s=self.sample_time_s, **{name: getattr(self, name)[:, samples] for name in ("r", *INPUTS)}
        )


@dataclass(frozen=True)
class YawModel:
    """A structure."""

    name: str  # "full", "separate" or "simplified"
    parameters: tuple[str, ...]  # names, the inertia first; SI
    damping: tuple[str, ...] = ("N_rr", "N_rv")  # those that cannot be positive

    def shapes(self, data: YawData) -> Array:
        """(4, k, n, p - 1): what every parameter but the inertia multiplies, as multiples of 1, r, |r| and r|r|."""
        u, v, phi = data.u, data.v, data.phi
        still, one = np.zeros_like(u), np.ones_like(u)
        table = {
            "M_v": (0, -data.sway_acceleration),
            "A": (1, u),
            "N_abs_u_r": (1, np.abs(u)),
            "m_xg": (1, -u),
            "N_rr": (3, one),
            "N_rv": (1, np.abs(v)),
            "N_phiur": (2, phi * u),
            "N_uv": (0, np.abs(u) * v),
            "N_phiuv": (0, phi * np.abs(u * v)),
            "N_phiuu": (0, phi * u * np.abs(u)),
        }
        known = [table[name] for name in self.parameters[1:]]
        columns = [[factor if power == place else still for place, factor in known] for power in range(4)]
        return np.ascontiguousarray(np.moveaxis(np.array(columns), (1, 2, 3), (3, 2, 1)))

    def terms(self, data: YawData) -> Array:
        """(n, k, p - 1): what every parameter but the inertia multiplies, along the measured motion."""
        constant, linear, even, odd = np.moveaxis(self.shapes(data), (1, 2), (2, 1))
        r = data.r[..., None]
        return np.asarray(constant + linear * r + (even + odd * r) * np.abs(r))


YAW_MODELS: Mapping[str, YawModel] = {
    model.name: model
    for model in (
        YawModel("full", ("I_r", "M_v", "A", "N_rr", "N_rv", "N_phiur", "N_uv", "N_phiuv", "N_phiuu")),
        YawModel("separate", ("I_r", "M_v", "N_abs_u_r", "m_xg", "N_rr", "N_rv", "N_uv")),
        YawModel("simplified", ("I_r", "A", "N_rr", "N_rv", "N_uv")),
    )
}
WORDS: Mapping[str, str] = {
    "I_r": "inertia in yaw", "M_v": "coupling to sway acceleration", "A": "damping and Coriolis moment",
    "N_rr": "damping by yaw", "N_rv": "damping by yaw and drift", "N_phiur": "moment of roll in turns",
    "N_uv": "moment of drift", "N_phiuv": "moment of roll and drift", "N_phiuu": "moment of roll at speed",
    "N_abs_u_r": "damping", "m_xg": "Coriolis moment",
}  # fmt: skip
"""Parameters in words."""


def term_budget(model: YawModel, data: YawData, parameters: Mapping[str, float]) -> dict[str, Array]:
    """Parameter -> (n, k) moment of its term [Nm] along the measured motion."""
    values = model.terms(data)
    return {name: parameters[name] * values[..., place] for place, name in enumerate(model.parameters[1:])}


MOMENT = "actuator_psi_nm"
SIDE = ("sway_acceleration_mps2", "lateral_acceleration_mps2")
SAMPLES = 250  # of a stretch, at most; more are averaged


def needed_columns(model: YawModel) -> tuple[str, ...]:
    """Columns beside u, v, r that every row must have."""
    return ("roll_rad", *SIDE, MOMENT) if "M_v" in model.parameters else (MOMENT,)


def voyages(
    model: YawModel, vessel: VesselModel, record: Record, *, length_s: float, finest_s: float = 0.0
) -> tuple[YawData, Array]:
    """Consecutive parts of a record, each a voyage of its own.

    Args:
        model: whose inputs are wanted.
        vessel: model of the ship, whose terms give the moment of the drives where none is measured.
        length_s: of a part [s]; what is left at the end of a batch is left out.
        finest_s: samples are averaged until they are as long [s].

    Returns:
        The parts, and (n, 2) the batch and the sample that each begins with.

    Raises:
        InputError: a signal that the model needs is not measured.
        NotInformative: no part is long enough.
    """
    parts: list[dict[str, Array]] = []
    begins: list[tuple[int, int]] = []
    step_s = record.batches[0].sample_time_s
    width = max(1, int(finest_s / step_s + 1e-9))
    samples = width * max(2, round(length_s / step_s / width))
    for number, (batch, moment) in enumerate(zip(record.batches, _moments(vessel, record), strict=True)):
        signals = {**_signals(model, batch), "moment": moment}
        for first in range(0, len(batch) - samples + 1, samples):
            cut = slice(first, first + samples)
            parts.append({name: _means(values[cut], width) for name, values in signals.items()})
            begins.append((number, first))
    if not parts:
        raise NotInformative(f"the data have no {length_s:g} s without a gap, which a yaw model is tried on")
    table = {name: np.stack([part[name] for part in parts]) for name in ("r", *INPUTS)}
    return YawData(sample_time_s=width * step_s, **table), np.array(begins, dtype=float)


def _means(values: Array, width: int) -> Array:
    return np.asarray(values.reshape(-1, width).mean(axis=1))


def _signals(model: YawModel, batch: Batch) -> dict[str, Array]:
    u, v, r = batch.velocity.T
    for name, values in (("u_mps", u), ("v_mps", v), ("r_radps", r)):
        if not np.isfinite(values).all():
            raise InputError(f"{batch.name} has no {name}, which the yaw model {model.name} reads; expected it")
    still = np.zeros(len(batch))
    signals = {"r": r, "u": u, "v": v, "phi": still, "sway_acceleration": still}
    if "M_v" in model.parameters:
        side = [name for name in SIDE if batch.measures(name)]
        missing = ["roll_rad"] * (not batch.measures("roll_rad")) + [" or ".join(SIDE)] * (not side)
        if missing:
            raise InputError(
                f"{batch.name} has no {' and no '.join(missing)}, which the yaw model full reads; expected these "
                "columns, or --model yaw-simplified"
            )
        measured = auxiliary(batch, side[0])
        signals["sway_acceleration"] = measured if side[0] == SIDE[0] else measured - u * r
        signals["phi"] = auxiliary(batch, "roll_rad")
    return signals


def auxiliary(batch: Batch, name: str) -> Array:
    """(k,) one of `AUXILIARY`, which the batch measures."""
    assert batch.auxiliary is not None
    return np.asarray(batch.auxiliary[:, AUXILIARY.index(name)])


def measures_moment(record: Record) -> bool:
    """Whether the yaw moment of the drives is measured throughout."""
    return all(batch.measures(MOMENT) for batch in record.batches)


def _moments(vessel: VesselModel, record: Record) -> list[Array]:
    """(k,) yaw moment of the drives in every batch: measured [Nm], or by the vessel's terms [rad/s2]."""
    if measures_moment(record):
        return [auxiliary(batch, MOMENT) for batch in record.batches]
    model = model_for(vessel, record)
    inputs = {*model.inputs, *FORCE_SIGNALS}
    drives = np.array(
        [
            value if term.equation == "r" and inputs & set(expression.signals) else 0.0
            for term, expression, value in zip(model.terms, model.expressions, model.parameters.tolist(), strict=True)
        ]
    )
    if not drives.any():
        raise InputError(
            f"the data have no {MOMENT}, and no term of r in the vessel file reads an actuator; expected one of these"
        )
    found = []
    for batch in with_delivered_inputs(record, model).batches:
        columns = [batch.inputs[:, batch.input_names.index(name)] for name in model.inputs]
        u, v, r = batch.velocity.T
        air = (u, v) if batch.wind is None else tuple(batch.wind.T)
        values = model.regressors((u, v, r), air, columns, NUMPY)
        found.append(np.asarray(sum(p * x for p, x in zip(drives, values, strict=True) if p) / model.time_scale_s))
    return found
