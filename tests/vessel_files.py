"""Vessel files with propeller and rudder, for tests on free-running models, and a small ship for made-up trials."""

from pathlib import Path

from real_data_cases import SIDE, TANK

Terms = tuple[tuple[str, str, str], ...]

KVLCC2_TERMS: Terms = TANK.terms
ESSO_TERMS: Terms = (
    ("u", "X_u", "u"),
    ("u", "X_abs_u_u", "u*abs(u)"),
    ("u", "X_vr", "v*r"),
    ("u", "X_nn", "abs(n1)*n1"),
    ("u", "X_un", "u*n1"),
    ("u", "X_rr", "r*r"),
    ("u", "X_dd", "abs(n1)*n1*rudder1*rudder1"),
    *SIDE,
)
WIND_TERMS: Terms = (
    ("u", "W_abs_u_u", "u_q*abs(u_q)"),
    ("v", "W_abs_v_v", "v_q*abs(v_q)"),
    ("r", "W_uv", "u_q*v_q"),
)
HULLS = {"kvlcc2-7m": (7.0, 1.2688, 0.4550, 0.05), "esso-osaka-3m": (3.0, 0.489, 0.201, 0.1)}


def vessel_text(name: str, terms: Terms) -> str:
    """A vessel file with one propeller, one rudder and all parameters zero."""
    length, beam, draught, step = HULLS[name]
    listed = "".join(f'[[model.terms]]\nequation = "{e}"\nname = "{n}"\nexpression = "{x}"\n\n' for e, n, x in terms)
    zeros = "".join(f"{name} = 0.0\n" for _, name, _ in terms)
    return f"""[vessel]
name = "{name}"
length_m = {length}
beam_m = {beam}
draught_m = {draught}
sample_time_s = {step}

[[actuators]]
kind = "propeller"
forward_m = {-0.48 * length}
speed_min_rps = -20.0
speed_max_rps = 20.0

[[actuators]]
kind = "rudder"
forward_m = {-0.5 * length}
angle_min_rad = -0.7
angle_max_rad = 0.7
angle_rate_radps = 0.35

[model]
structure = "custom"
form = "continuous"

{listed}[model.parameters]
{zeros}
[sensors]
velocity_mps = 0.01
yaw_rate_radps = 0.002
"""


KVLCC2 = vessel_text("kvlcc2-7m", KVLCC2_TERMS)
ESSO_WIND = vessel_text("esso-osaka-3m", (*ESSO_TERMS, *WIND_TERMS))


def write_vessel(path: Path, text: str) -> Path:
    """Write a vessel file."""
    path.write_text(text, encoding="utf-8")
    return path
