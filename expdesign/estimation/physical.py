"""Masses and force coefficients from regression parameters, and back.

Every equation is divided by its inertia, so a manoeuvring model shows m_u = m - X_udot, m_v = m - Y_vdot and
I = I_z - N_rdot only in ratios:

    X_vr = T m_v / m_u     Y_ur = -T m_u / m_v     N_uv = T (m_u - m_v) / I     X_mu = T mu / m_u  ...

with T the sample time in discrete form, 1 in continuous form. One physical number from elsewhere (the thrust gain mu or
the surge inertia m_u) sets the scale; then m_u, m_v, I and every coefficient follow. What cannot be had: m and X_udot
apart (only their difference acts), the scale itself, and the lift part of N_uv, which is why I comes from the thrust
moment N_mu and not from N_uv. The products X_vr Y_ur / T^2 = -1 and N_uv I / (T (m_u - m_v)) = 1 hold for a body that
obeys the rigid-body and added-mass terms alone; how far data are from that is returned as a check, not enforced.

Source: F. Ljungberg, doctoral thesis, Linköping University, (3.58)-(3.64).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from expdesign.errors import InputError
from expdesign.vessel import VesselModel

COUPLINGS = ("X_vr", "Y_ur", "N_uv")


@dataclass(frozen=True, kw_only=True)
class PhysicalModel:
    """A manoeuvring model in physical coefficients.

    Attributes:
        m_u, m_v: mass with added mass, surge and sway [kg].
        inertia: yaw inertia with added inertia [kg m2].
        forces: parameter name -> coefficient of that term's force or moment, e.g. X_u [N s/m], X_mu = mu [N s]; a
            coupling X_vr, Y_ur or N_uv that is not listed follows from the masses.
        coupling_checks: coupling -> its value over what the masses give; 1 for an ideal body.
    """

    m_u: float
    m_v: float
    inertia: float
    forces: Mapping[str, float]
    coupling_checks: Mapping[str, float]


def to_physical(model: VesselModel, *, thrust_gain: float | None = None, m_u: float | None = None) -> PhysicalModel:
    """Physical coefficients of a model with thrust terms X_mu, Y_mu and N_mu of one common gain.

    Args:
        model: its parameters are read.
        thrust_gain: mu, force per unit of tau [N per unit]; or
        m_u: surge mass with added mass [kg]. Exactly one sets the scale.

    Raises:
        InputError: no scale, two scales, or no thrust terms.
    """
    values, T = dict(zip(model.names, model.parameters.tolist(), strict=True)), model.time_scale_s
    lacking = [name for name in ("X_mu", "Y_mu", "N_mu") if not values.get(name)]
    if lacking:
        raise InputError(f"masses need the thrust parameter {lacking[0]}, which the model lacks or has zero")
    if (thrust_gain is None) == (m_u is None):
        raise InputError("masses are known up to one scale: give either thrust_gain or m_u")
    mu = thrust_gain if thrust_gain is not None else float(m_u or 0.0) * values["X_mu"] / T
    inertias = {"u": T * mu / values["X_mu"], "v": T * mu / values["Y_mu"], "r": T * mu / values["N_mu"]}
    if not all(value > 0 for value in inertias.values()):
        raise InputError("masses come out negative: thrust parameters and scale need the same sign")
    ideal = _couplings(inertias["u"], inertias["v"], inertias["r"])
    forces = {term.name: values[term.name] * inertias[term.equation] / T for term in model.terms}
    checks = {name: values[name] / (T * ideal[name]) for name in COUPLINGS if name in values and ideal[name]}
    return PhysicalModel(
        m_u=inertias["u"], m_v=inertias["v"], inertia=inertias["r"], forces=forces, coupling_checks=checks
    )


def from_physical(physical: PhysicalModel, model: VesselModel) -> VesselModel:
    """The model with parameters from physical coefficients; couplings without a coefficient follow from the masses.

    Raises:
        InputError: a term has no coefficient.
    """
    inertias = {"u": physical.m_u, "v": physical.m_v, "r": physical.inertia}
    ideal, T = _couplings(physical.m_u, physical.m_v, physical.inertia), model.time_scale_s
    values = {}
    for term in model.terms:
        if term.name in physical.forces:
            values[term.name] = T * physical.forces[term.name] / inertias[term.equation]
        elif term.name in ideal:
            values[term.name] = T * ideal[term.name]
        else:
            raise InputError(f"the physical model has no coefficient for {term.name}")
    return model.with_parameters(values)


def _couplings(m_u: float, m_v: float, inertia: float) -> dict[str, float]:
    """Continuous couplings of an ideal body."""
    return {"X_vr": m_v / m_u, "Y_ur": -m_u / m_v, "N_uv": (m_u - m_v) / inertia}
