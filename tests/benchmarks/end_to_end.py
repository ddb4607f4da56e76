"""Published ships from particulars to a diagnosis: planned, sailed by their published models, estimated and diagnosed.

Of each ship her particulars, one circle and one speed are known. Her candidates and her bay are those of
`expdesign new --card`, without the crash stop, as most published models know no engine astern, and of ships with two
propellers without what has them apart.
The runs that the plan chooses are sailed by the published model, which has another structure than the vessel file, and
measured with noise. The vessel that `estimate` then finds predicts
circles and zig-zags with intervals; they are compared with those of the published model.

    PYTHONPATH=tests/benchmarks python tests/benchmarks/end_to_end.py kcs mariner
    PYTHONPATH=tests/benchmarks python tests/benchmarks/end_to_end.py kcs --draft

Without ships all of them; with --draft the plan is not verified, with --unplanned every candidate is sailed once, which
takes a tenth of the time.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import published_models as published
import published_trials as trials
from expdesign.cli import main as expdesign
from expdesign.dictionary import Primitive, build_dictionary
from expdesign.errors import InputError
from expdesign.export.files import vessel_toml
from expdesign.export.folder import write_files
from expdesign.particulars import Stated, expected
from expdesign.particulars.forces import design_speed
from expdesign.scenario import Scenario, load_scenario, load_vessel
from expdesign.simulation import steady_ahead
from expdesign.vessel import Sensors, Vessel, VesselModel
from expdesign.workflows.commands.new import BLOCK, kind_of, of_card
from particulars import MODELS, case, known_of

SHIPS = MODELS | {
    "kcs-model": lambda: trials.froude(published.kcs(), 1.0 / 75.5),
    "esso-osaka": lambda: trials.froude(published.esso_osaka(), 325.0 / 3.0),
}
METHODS = ("ls", "iv", "oe")
STEPS = 10  # of the published model in a sample


@dataclass(frozen=True)
class Outcome:
    """What came of one ship."""

    ship: str
    plan: str  # verified or not, and how long, or why not
    prior: str  # joined with the estimate, "none" where the data alone tell enough
    known: int  # trial values of the published model in the 95 % intervals of the card's vessel
    inside: int  # the same of the estimated vessel
    values: int
    error: float  # median of the sizes of logarithms of predicted by true
    before: float  # the same of the vessel of particulars
    said: str  # by the diagnosis, first
    seconds: float  # of processor


def folder_of(name: str, folder: Path) -> Scenario:
    """What `new --card` makes of the ship, measured by sensors of her size, without what takes engines astern."""
    one = case(name, SHIPS[name]())
    card = replace(one.card, stated=known_of(one))
    write_files(folder, of_card(name, kind_of(card), card, command="").texts)
    found, swift = load_vessel(folder / "vessel.toml"), design_speed(card)
    noise = Sensors(
        position_m=0.005 * found.length_m, heading_rad=0.003, velocity_mps=0.005 * swift,
        yaw_rate_radps=0.0005 * swift / found.length_m,
    )  # fmt: skip
    sample_s = max(0.1, round(0.08 * found.length_m / swift, 1))
    found = replace(found, sample_time_s=sample_s, model=replace(found.model, sample_time_s=sample_s), sensors=noise)
    (folder / "vessel.toml").write_text(vessel_toml(found), "utf-8")
    ahead = replace(found, model=ahead_only(found.model))
    (folder / "vessel-ahead.toml").write_text(vessel_toml(ahead), "utf-8")
    listed = (folder / "dictionary.toml").read_text("utf-8").split(BLOCK)
    apart = ('"stop"', '"zigzag"', '"sway-zigzag"') if kind_of(card) == "twin-screw" else ('"stop"',)
    (folder / "dictionary.toml").write_text(
        BLOCK.join(one for one in listed if not any(f"name = {name}" in one for name in apart)), "utf-8"
    )
    astern = sorted({*found.model.names} - {*ahead.model.names})
    task = (folder / "scenario.toml").read_text("utf-8")
    task = task.replace("[design]", f"[design]\nfixed_parameters = {json.dumps(astern)}")
    (folder / "scenario.toml").write_text(task, "utf-8")
    return load_scenario(folder / "scenario.toml")


def ahead_only(model: VesselModel) -> VesselModel:
    """The model without the terms that act with the engines astern alone, as no run tells of them."""
    kept = np.array([not name.endswith("_astern") for name in model.names])
    names = {name for name, stays in zip(model.names, kept.tolist(), strict=True) if stays}
    pairs = model.parameter_correlation.items()
    return replace(
        model, terms=tuple(term for term in model.terms if term.name in names), parameters=model.parameters[kept],
        parameter_std=model.parameter_std[kept],
        parameter_correlation={pair: value for pair, value in pairs if names.issuperset(pair)},
        parameter_range={name: ends for name, ends in model.parameter_range.items() if name in names},
    )  # fmt: skip


def of_second_side(vessel: Vessel) -> list[str]:
    """Parameters of the second propeller and rudder of ships with two of each, which no run here orders apart.

    They stay as the card has them, and those of the first side tell of both.
    """
    names = vessel.model.names
    both = [name for name in names if "2" in name and name.replace("2", "1") in names]
    return both if "rudder2" in vessel.model.inputs else []


def sailed(model: trials.Model, vessel: Vessel, run: Primitive, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """What the sensors read of the published model under the commands of a run, which it begins steadily or at rest."""
    begins_mps, fastest_mps = float(np.hypot(*run.entry_velocity[:2])), float(run.trajectory.velocity[:, 0].max())
    approach = steady_ahead(vessel, begins_mps or fastest_mps)
    values, sample_s = run.commands.values, vessel.sample_time_s
    holds = trials.order_for(model, approach.speed_mps) / approach.drive  # the engine order that holds is her own
    engines, helms = orders(vessel, values)
    state = np.array([*run.entry_velocity, 0.0, 0.0, 0.0])
    angle, states = 0.0, []
    for engine, helm in zip((holds * engines).tolist(), (approach.starboard * helms).tolist(), strict=True):
        states.append(state)
        for _ in range(STEPS):
            step = sample_s / STEPS
            angle += float(np.clip(helm - angle, -model.helm_rate_radps * step, model.helm_rate_radps * step))
            state = stepped(model, state, angle, engine, step)
    u, v, r, north, east, heading = np.array(states).T
    noise, count = vessel.sensors, len(values)

    def read(signal: np.ndarray, std: float) -> np.ndarray:
        return np.asarray(signal + std * rng.standard_normal(count))

    return {
        "time_s": sample_s * np.arange(count),
        "north_m": read(north, noise.position_m), "east_m": read(east, noise.position_m),
        "heading_rad": read(heading, noise.heading_rad), "u_mps": read(u, noise.velocity_mps),
        "v_mps": read(v, noise.velocity_mps), "r_radps": read(r, noise.yaw_rate_radps),
        **{f"{signal}_{'rps' if signal.startswith('n') else 'rad'}": values[:, column]
           for column, signal in enumerate(vessel.model.inputs)},
    }  # fmt: skip


def orders(vessel: Vessel, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Engine orders (k,) and helms (k,) of commands (k, m): of one propeller and one rudder, or of one on each side."""
    columns = dict(zip(vessel.model.inputs, values.T, strict=True))
    full = {name: limit.high for name, limit in zip(vessel.model.inputs, vessel.limits, strict=True)}
    if "rudder1" in columns:
        return columns["n1"] / full["n1"], columns["rudder1"]
    port, starboard = columns["n1"] / full["n1"], columns["n2"] / full["n2"]
    return (port + starboard) / 2.0, np.arcsin(np.clip((port - starboard) / 2.0, -1.0, 1.0))


def stepped(model: trials.Model, state: np.ndarray, angle: float, order: float, step: float) -> np.ndarray:
    """One Runge-Kutta step of a state (6,)."""

    def rates(x: np.ndarray) -> np.ndarray:
        c, s = math.cos(x[5]), math.sin(x[5])
        return np.array([*model.rates(x[:3], angle, order), x[0] * c - x[1] * s, x[0] * s + x[1] * c, x[2]])

    k1 = rates(state)
    k2 = rates(state + step / 2 * k1)
    k3 = rates(state + step / 2 * k2)
    k4 = rates(state + step * k3)
    return np.asarray(state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


def deviations(vessel: Vessel, values: Iterable[Stated]) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of predicted by true values, and whether the true ones lie in the 95 % intervals of `indices`."""
    by_key = {
        (one.trial, one.quantity): one for one in expected(vessel, dict.fromkeys(value.trial for value in values))
    }
    found = [(by_key[value.trial, value.quantity], value.value) for value in values]
    errors = [math.log(one.value / value) if 0 < one.value < math.inf else math.inf for one, value in found]
    return np.array(errors), np.array([one.low <= value <= one.high for one, value in found])


def outcome(
    name: str,
    folder: Path,
    *,
    planned: bool = True,
    diagnosed: bool = True,
    methods: Iterable[str] = METHODS,
    options: Iterable[str] = (),
) -> Outcome:
    """One ship, in a folder that is made; `options` are those of `run`."""
    began = time.process_time()
    model = SHIPS[name]()
    files, one, rng = folder_of(name, folder), case(name, model), np.random.default_rng(0)
    runs, plan = build_dictionary(files.vessel, files.dictionary), "not asked for"
    if planned:
        status = expdesign(["run", str(folder / "scenario.toml"), "--out", str(folder / "plan"), "--quiet", *options])
        plan = f"refused ({status})"
        if status == 0:
            told = json.loads((folder / "plan" / "plan.json").read_text("utf-8"))
            plan = "drafted" if told.get("draft") else "verified" if told["verified"] else "not verified"
            plan += f", {(told['informative_s'] + told['reposition_s']) / 60:.0f} min"
            chosen = {leg["name"] for leg in told["legs"]}
            runs = tuple(run for run in runs if run.name in chosen)
    data = []
    for run in runs:
        columns = sailed(model, files.vessel, run, rng)
        data.append(folder / f"{run.name}.csv")
        np.savetxt(data[-1], np.array(list(columns.values())).T, "%.9g", ",", header=",".join(columns), comments="")
    second = [name for name in of_second_side(files.vessel) if not name.endswith("_astern")]
    common = [*map(str, data), "--vessel", str(folder / "vessel-ahead.toml"), "--quiet"]
    error, joined = math.nan, ""
    inside = np.array([], dtype=bool)
    errors, known = deviations(files.vessel, one.values)
    before = float(np.median(np.abs(errors)))
    # the data alone, or what the card says beside them where these say too little
    for prior in ("none", "parameter_std"):
        asked = ["--prior", prior, "--method", *methods, "--out", str(folder / "estimate")]
        asked += ["--fixed", *second] if second else []
        if expdesign(["estimate", *common, *asked]) != 0:
            continue
        with suppress(InputError):  # hardly any ship that the estimate draws brakes, or steers to the right side
            errors, inside = deviations(load_vessel(folder / "estimate" / "vessel-estimated.toml"), one.values)
            error, joined = float(np.median(np.abs(errors))), prior
            if math.isfinite(error):  # else the estimated vessel herself does not
                break
    said = "not asked for"
    if diagnosed:
        status = expdesign(["diagnose", *common, "--out", str(folder / "diagnosis")])
        said = f"status {status}"
    if diagnosed and status == 0:
        said = str(json.loads((folder / "diagnosis" / "diagnosis.json").read_text("utf-8"))["verdict"])
    return Outcome(
        ship=name, plan=plan, prior=joined, known=int(known.sum()), inside=int(inside.sum()), values=len(inside),
        error=error, before=before, said=said, seconds=time.process_time() - began,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ships", nargs="*", default=SHIPS)
    parser.add_argument("--unplanned", action="store_true", help="sail every candidate once, without a plan")
    parser.add_argument("--draft", action="store_true", help="sail the runs of a plan that is not verified")
    asked = parser.parse_args()
    print("| ship | plan | in 95 %: card | estimate | median error: card | estimate | diagnosis | processor |")
    print("|---|---|---|---|---|---|---|---|")
    for name in asked.ships:
        with tempfile.TemporaryDirectory() as folder:
            options = ["--jobs", "1", *(["--draft"] if asked.draft else [])]  # so that all work is counted
            row = outcome(name, Path(folder) / name, planned=not asked.unplanned, options=options)
        share = f"{row.inside} of {row.values}{' (prior)' * (row.prior == 'parameter_std')}" if row.values else "-"
        errors = f"{math.expm1(row.before):.0%} | {math.expm1(row.error):.0%}" if row.values else "- | -"
        cells = f"{row.plan} | {row.known} | {share} | {errors} | {row.said}"
        print(f"| {name} | {cells} | {row.seconds:.0f} s |", flush=True)


if __name__ == "__main__":
    main()
