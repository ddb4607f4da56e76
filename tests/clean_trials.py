"""Trials in which nothing is hidden, and the p-values of everything that is tested in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis_case import from_pose
from expdesign.diagnosis.motion import initial_states, stable_windows
from expdesign.diagnosis.select import fit_nuisance, score_tests
from expdesign.diagnosis.select.selection_round import open_candidates
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.signals import Batch, Commands, Record
from expdesign.simulation import CALM, measure, simulate
from expdesign.vessel import Actuator, Limit, Sensors, Term, Vessel, VesselModel

TERMS = {
    "X_uu": ("u", "abs(u)*u", -0.004), "X_nn": ("u", "abs(n1)*n1", 0.008), "X_vr": ("u", "v*r", 1.2),
    "Y_uv": ("v", "abs(u)*v", -0.02), "Y_ur": ("v", "u*r", -0.3), "N_ur": ("r", "abs(u)*r", -0.02),
    "N_ud": ("r", "abs(u)*u*sin(rudder1)", 0.0005),
}  # fmt: skip
SHIP_50M = Vessel(
    name="ship of 50 m", length_m=50.0, beam_m=9.0, draught_m=3.0, sample_time_s=1.0,
    model=VesselModel(
        terms=tuple(Term(equation, name, text) for name, (equation, text, _) in TERMS.items()),
        parameters=np.array([value for *_, value in TERMS.values()]), parameter_std=np.zeros(len(TERMS)),
        form="continuous", sample_time_s=1.0,
        actuators=(
            Actuator(kind="propeller", number=1, forward_m=-23.0, limits=(Limit(low=-3.0, high=4.0),)),
            Actuator(kind="rudder", number=1, forward_m=-24.0, limits=(Limit(low=-0.6, high=0.6),)),
        ),
    ),
    sensors=Sensors(position_m=0.3, heading_rad=0.003, velocity_mps=0.02, yaw_rate_radps=0.001),
)  # fmt: skip
HELD_S = (20.0, 60.0)
AXES = ("u_mps", "v_mps", "r_radps"), ("north_m", "east_m", "heading_rad")
SEARCHED = ("change", "deadband", "roll")  # kinds of candidates of which several share a number that is looked for


def at_rate(vessel: Vessel, sample_time_s: float) -> Vessel:
    """The same ship, of continuous motion, sampled otherwise."""
    return replace(vessel, sample_time_s=sample_time_s, model=replace(vessel.model, sample_time_s=sample_time_s))


def orders(vessel: Vessel, samples: int, rng: np.random.Generator) -> np.ndarray:
    """(k, m): speeds ahead of 40 to 90 % of the most, angles to 0.5 rad, forces to 60 %."""
    columns = []
    limits = {name: one for item in vessel.model.actuators for name, one in zip(item.signals, item.limits, strict=True)}
    for name in vessel.model.inputs:
        most = limits[name].high
        low, high = (0.4 * most, 0.9 * most) if name.startswith("n") else (-0.6 * most, 0.6 * most)
        low, high = (-0.5, 0.5) if name.startswith(("a", "rudder")) else (low, high)
        spans = (rng.uniform(*HELD_S, samples) / vessel.sample_time_s).astype(int)
        columns.append(np.repeat(rng.uniform(low, high, samples), spans)[:samples])
    return np.column_stack(columns)


def clean_trial(vessel: Vessel, rng: np.random.Generator, *, runs=4, run_s=300.0, pose_only=False) -> Record:
    """Runs from rest, in calm air and water."""
    batches, samples = [], round(run_s / vessel.sample_time_s)
    for number in range(runs):
        commands = Commands(
            names=vessel.model.inputs, values=orders(vessel, samples, rng), sample_time_s=vessel.sample_time_s
        )
        sailed = simulate(vessel, commands, substeps=max(2, round(vessel.sample_time_s / 0.1)))
        seen = measure(vessel, commands, sailed, environment=CALM, rng=rng)
        velocity, pose = (np.stack([seen[name] for name in names], axis=1) for names in AXES)
        pose[:, 2] = np.unwrap(pose[:, 2])
        batch = Batch(
            name=f"run {number}", sample_time_s=vessel.sample_time_s, input_names=commands.names,
            inputs=commands.values, velocity=velocity, pose=pose,
        )  # fmt: skip
        batches.append(from_pose(batch, wind=False) if pose_only else batch)
    return Record(batches=tuple(batches))


def p_values(vessel: Vessel, record: Record) -> tuple[dict[tuple, float], float]:
    """Each candidate's own p-value beside the model in use, and the smallest that is adjusted for their number."""
    model = extended_model(vessel, record)
    windows = stable_windows(model, record)
    base = fit_nuisance(model, windows, initial_states(windows, model.states))
    tests = score_tests(base, open_candidates(base, windows), np.random.default_rng(0))
    own = {
        (one.candidate.cause, *one.candidate.free.items()): one.p_value
        for one in tests
        if not one.candidate.fixed and not any(key.startswith(SEARCHED) for key in one.candidate.free)
    }
    return own, min(one.adjusted for one in tests)
