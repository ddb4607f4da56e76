"""An 80 m ship of invented numbers whose model reads propeller and rudder directly."""

import numpy as np

from expdesign.vessel import Actuator, Limit, Response, Term, Vessel, VesselModel

TERMS = {
    Term("u", "X_uu", "abs(u)*u"): -0.004,
    Term("u", "X_vr", "v*r"): 0.6,
    Term("u", "X_n", "abs(n1)*n1"): 0.01,
    Term("u", "X_d", "u*abs(u)*sin(rudder1)*sin(rudder1)"): -0.01,
    Term("v", "Y_v", "abs(u)*v"): -0.02,
    Term("v", "Y_r", "u*r"): -0.5,
    Term("v", "Y_d", "u*abs(u)*sin(rudder1)"): 0.006,
    Term("r", "N_v", "abs(u)*v"): -0.0002,
    Term("r", "N_r", "abs(u)*r"): -0.06,
    Term("r", "N_d", "u*abs(u)*sin(rudder1)"): -0.0006,
}
"""A symmetric ship of invented numbers: positive rudder turns it to port."""


def rudder_ship() -> Vessel:
    """Propeller and rudder."""
    propeller = Actuator(
        kind="propeller",
        number=1,
        forward_m=-40.0,
        limits=(Limit(low=-3.0, high=4.0),),
        responses=(Response(rate=0.5),),
    )
    rudder = Actuator(
        kind="rudder",
        number=1,
        forward_m=-40.0,
        limits=(Limit(low=-0.7, high=0.7),),
        responses=(Response(rate=0.05),),
    )
    model = VesselModel(
        terms=tuple(TERMS),
        parameters=np.array(list(TERMS.values())),
        parameter_std=np.zeros(len(TERMS)),
        form="continuous",
        sample_time_s=1.0,
        actuators=(propeller, rudder),
    )
    return Vessel(name="rudder ship", length_m=80.0, beam_m=14.0, draught_m=5.0, sample_time_s=1.0, model=model)
