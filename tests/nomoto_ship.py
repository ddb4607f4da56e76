"""A ship whose yaw obeys the first-order equation of Nomoto exactly, at a constant surge speed: closed forms exist."""

import numpy as np

from expdesign.vessel import Actuator, Limit, Response, Term, Vessel, VesselModel

GAIN, LAG = 0.08, 9.0


def nomoto_ship(
    *, sample_time_s: float = 0.5, sense: float = -1.0, bias: float = 0.0, helm_rate: float = 0.05
) -> Vessel:
    """A ship with propeller and rudder: LAG r' + r = sense GAIN (rudder + bias), steady at 7 m/s."""
    rows = {
        Term("u", "X_abs_u_u", "u*abs(u)"): -1e-3,
        Term("u", "X_nn", "abs(n1)*n1"): 1e-3,
        Term("r", "N_r", "r"): -1 / LAG,
        Term("r", "N_d", "rudder1"): sense * GAIN / LAG,
        Term("r", "N_0", "1"): sense * GAIN / LAG * bias,
    }
    actuators = (
        Actuator(kind="propeller", number=1, limits=(Limit(low=-6, high=10),), responses=(Response(rate=2),)),
        Actuator(
            kind="rudder",
            number=1,
            forward_m=-50,
            limits=(Limit(low=-0.7, high=0.7),),
            responses=(Response(rate=helm_rate),),
        ),
    )
    model = VesselModel(
        terms=tuple(rows),
        parameters=np.array(list(rows.values())),
        parameter_std=np.zeros(len(rows)),
        form="continuous",
        sample_time_s=sample_time_s,
        actuators=actuators,
    )
    return Vessel(name="nomoto", length_m=100, beam_m=15, draught_m=5, sample_time_s=sample_time_s, model=model)
