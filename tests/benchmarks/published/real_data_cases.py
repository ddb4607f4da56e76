"""The two tankers of the study on real data: particulars, model terms, and which runs are used for what.

Source: SIMMAN benchmark, free-running tests at HSVA (KVLCC2, 7 m); Y. Wakita et al., Journal of Marine Science and
Technology 27 (2022), 10.1007/s00773-021-00867-1 (Esso Osaka, 3 m).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.vessel import Actuator, Limit, Response, Term, Vessel, VesselModel


@dataclass(frozen=True, kw_only=True)
class Case:
    """Measured trials of one ship, and how they are used.

    Attributes:
        folder: where its CSV files are, within the data folder.
        hull: length, beam, draught [m].
        sample_time_s: of the data.
        terms: (equation, name, expression) of the model.
        used, tests: how the names of their files begin; what is in neither is left alone.
        methods: name and horizon [s] of each.
        window_s: of the smoothed accelerations.
        published: R^2 of u, v, r that others found, with wind where it is used.
        mean: subtracted from instruments.
    """

    folder: str
    hull: tuple[float, float, float]
    sample_time_s: float
    terms: tuple[tuple[str, str, str], ...]
    used: tuple[str, ...]
    tests: tuple[str, ...]
    methods: tuple[tuple[str, float | None], ...]
    window_s: float
    published: tuple[float, float, float]
    mean: str


SIDE = tuple(
    (equation, f"{letter}_{name}", expression)
    for equation, letter in (("v", "Y"), ("r", "N"))
    for name, expression in (
        ("v", "v"),
        ("r", "r"),
        ("abs_v_v", "v*abs(v)"),
        ("abs_r_r", "r*abs(r)"),
        ("uv", "u*v"),
        ("ur", "u*r"),
        ("uud", "u*abs(u)*rudder1"),
        ("nnd", "abs(n1)*n1*sin(rudder1)"),
    )
)
TANK = Case(
    folder="kvlcc2-hsva-7m",
    hull=(7.0, 1.2688, 0.4550),
    sample_time_s=0.05,
    terms=(
        ("u", "X_abs_u_u", "u*abs(u)"),
        ("u", "X_vr", "v*r"),
        ("u", "X_nn", "abs(n1)*n1"),
        ("u", "X_rr", "r*r"),
        ("u", "X_dd", "u*abs(u)*rudder1*rudder1"),
        *SIDE,
    ),
    used=("zigzag_10_05", "zigzag_15_05", "zigzag_25_05"),
    tests=("zigzag_20_10_p", "zigzag_30_05", "zigzag_10_10_p", "zigzag_10_01", "zigzag_15_01"),
    methods=(("ls", None), ("iv", None), ("oe", None), ("oe", 30.0)),
    window_s=4.0,
    published=(0.98, 1.00, 0.98),
    mean="none",
)
POND = Case(
    folder="esso-osaka-3m",
    hull=(3.0, 0.489, 0.201),
    sample_time_s=0.1,
    terms=(
        ("u", "X_u", "u"),
        ("u", "X_abs_u_u", "u*abs(u)"),
        ("u", "X_vr", "v*r"),
        ("u", "X_nn", "abs(n1)*n1"),
        ("u", "X_un", "u*n1"),
        ("u", "X_rr", "r*r"),
        ("u", "X_dd", "abs(n1)*n1*rudder1*rudder1"),
        *SIDE,
        ("u", "W_abs_u_u", "u_q*abs(u_q)"),
        ("v", "W_abs_v_v", "v_q*abs(v_q)"),
        ("r", "W_uv", "u_q*v_q"),
    ),
    used=(
        "random_06-Aug-2020_16_24_25_1",
        "random_06-Aug-2020_16_24_25_4",
        "random_06-Aug-2020_16_24_25_6",
        "random_31-Jul-2020_12_29",
        "zigzag_31-Jul-2020_13_04",
        "zigzag_31-Jul-2020_13_14",
        "zigzag_31-Jul-2020_13_42",
        "zigzag_31-Jul-2020_13_50",
        "zigzag_31-Jul-2020_14_03",
    ),
    tests=(
        "random_03-Aug",
        "random_06-Aug-2020_16_24_25_5",
        "zigzag_31-Jul-2020_13_22",
        "zigzag_31-Jul-2020_13_57",
        "turn_14-Oct-2020_14_08",
        "turn_14-Oct-2020_14_29",
    ),
    methods=(("ls", None), ("ls-air", None), ("iv", None), ("iv-air", None), ("iv-wind", None), ("oe-air", 30.0)),
    window_s=8.0,
    published=(0.70, 0.74, 0.66),
    mean="complete",
)
CASES = (TANK, POND)


def vessel_of(case: Case) -> Vessel:
    """The ship with all parameters zero: nothing is known before."""
    terms = tuple(Term(*row) for row in case.terms)
    zeros = np.zeros(len(terms))
    propeller = Actuator(kind="propeller", number=1, limits=(Limit(low=-20, high=20),))
    rudder = Actuator(kind="rudder", number=1, limits=(Limit(low=-0.7, high=0.7),), responses=(Response(rate=0.35),))
    model = VesselModel(
        terms=terms,
        parameters=zeros,
        parameter_std=zeros,
        form="continuous",
        sample_time_s=case.sample_time_s,
        actuators=(propeller, rudder),
    )
    length, beam, draught = case.hull
    return Vessel(
        name=case.folder,
        length_m=length,
        beam_m=beam,
        draught_m=draught,
        sample_time_s=case.sample_time_s,
        model=model,
    )
