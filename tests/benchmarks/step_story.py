"""From a craft that is hardly known to one with a model: what each stage of the trials gains in accuracy per minute.

``python tests/benchmarks/step_story.py [--trials N] [--seed S]``: the runs of the step trial that
`scenarios/fast-boat.toml` requires are sailed by `fast-8m-true.toml` with noise, in waves that move it by 0.1 m/s, with
dead times of 0.5 s. `identify-steps` updates the vessel file. Then ten minutes are shared out by information, the
steps' as prior: among `dictionaries/fast-8m.toml`, sailed the same way, and beside it among the steps themselves.
`estimate --method oe` gives estimates, once with the dead times that the steps gave and once with the true ones.
They are joined with those of the steps by their covariances. The error is the root mean square over parameters of the
error over the first standard deviation, the stated one the same of standard deviations.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from expdesign.cli import main
from expdesign.dictionary import Primitive, build_dictionary
from expdesign.export.files import vessel_toml
from expdesign.scenario import Scenario, load_dictionary, load_scenario, load_vessel
from expdesign.simulation import Environment, Variation, draw_weather, measure, simulate
from expdesign.vessel import Vessel, VesselModel
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.scored import scored
from step_case import TRUTH, write_csv

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = ("time_s", "u_mps", "v_mps", "r_radps", "n1_rps", "rudder1_rad")
SEA = Environment(current_variation=Variation(std_mps=0.1, correlation_s=1.0))
DESIGNED_S = 600.0


def sailed(folder: Path, runs: Sequence[Primitive], rng: np.random.Generator) -> list[str]:
    """Files of measured data, one for each run; the true craft has held the entry's commands for a minute before it."""
    truth, paths = load_vessel(TRUTH), []
    for number, run in enumerate(runs):
        held = round(60.0 / truth.sample_time_s)
        commands = replace(run.commands, values=np.vstack([np.tile(run.entry_inputs, (held, 1)), run.commands.values]))
        met = draw_weather(SEA, len(commands), sample_time_s=commands.sample_time_s, rng=rng)
        motion = simulate(truth, commands, velocity=run.entry_velocity, standing=run.entry_inputs, environment=met)
        columns = measure(truth, commands, motion, environment=met, rng=rng)
        paths.append(str(write_csv(folder / f"run-{number}.csv", columns, NAMES)))
    return paths


def chosen(case: Scenario, dictionary: str, vessel: Vessel) -> list[Primitive]:
    """The whole runs of a dictionary that tell most in `DESIGNED_S` beside what the vessel file knows."""
    settings = replace(case.design, total_s=DESIGNED_S, limits=replace(case.design.limits, required=()))
    specs = load_dictionary(SCENARIOS / "dictionaries" / dictionary)
    now = replace(case, vessel=vessel, dictionary=specs, design=settings)
    information = scored(now)
    design = designed(now, information, seed=0)
    runs = build_dictionary(vessel, specs)
    return [run for run, times in zip(runs, design.repeats, strict=True) for _ in range(round(times))]


def joined(one: VesselModel, other: VesselModel) -> tuple[np.ndarray, np.ndarray]:
    """(p,) values and (p, p) covariance of two independent estimates together."""
    weights = [np.linalg.inv(model.parameter_covariance) for model in (one, other)]
    covariance = np.linalg.inv(sum(weights))
    return covariance @ (weights[0] @ one.parameters + weights[1] @ other.parameters), covariance


def estimated(folder: Path, data: Sequence[str], vessel: Path) -> VesselModel:
    """The model that output error finds in data."""
    words = ["estimate", *data, "--vessel", str(vessel), "--method", "oe", "--mean", "none"]
    if main([*words, "--out", str(folder), "--quiet"]):
        raise SystemExit("estimate found no answer")
    return load_vessel(folder / "vessel-estimated.toml").model


def trial(case: Scenario, folder: Path, seed: int) -> dict[str, tuple[float, float, float]]:
    """Minutes, error and stated error of each stage."""
    rng = np.random.default_rng(seed)
    first = load_vessel(SCENARIOS / "vessels" / "fast-8m.toml").model
    truth = load_vessel(TRUTH).model.parameters
    steps = [run for run in build_dictionary(case.vessel, case.dictionary) if run.name in case.design.limits.required]
    data = sailed(folder, steps, rng)
    words = ["identify-steps", *data, "--vessel", str(SCENARIOS / "vessels" / "fast-8m.toml"), "--out", str(folder)]
    if main([*words, "--quiet"]):
        raise SystemExit("identify-steps found no answer")
    path = folder / "vessel-steps.toml"
    known = load_vessel(path)

    def row(minutes: float, value: np.ndarray, covariance: np.ndarray) -> tuple[float, float, float]:
        sizes = (value - truth) / first.parameter_std, np.sqrt(np.diag(covariance)) / first.parameter_std
        return minutes, *(float(np.sqrt(np.mean(size**2))) for size in sizes)

    minutes = sum(run.duration_s for run in steps) / 60.0
    rows = {
        "builder's guess": row(0.0, first.parameters, first.parameter_covariance),
        "step trial": row(minutes, known.model.parameters, known.model.parameter_covariance),
    }
    actuators = load_vessel(TRUTH).actuators
    prompt = replace(known, model=replace(known.model, actuators=actuators), std={})
    files = {"": path, ", true dead times": folder / "prompt.toml"}
    files[", true dead times"].write_text(vessel_toml(prompt), encoding="utf-8")
    for name, dictionary in (("designed trial", "fast-8m.toml"), ("more steps instead", "step-trial.toml")):
        runs = chosen(case, dictionary, known)
        (folder / dictionary).mkdir()
        data = sailed(folder / dictionary, runs, rng)
        more = sum(run.duration_s for run in runs) / 60.0
        for which, file in files.items():
            found = estimated(folder / f"{dictionary}{which}", data, file)
            rows[name + which] = row(minutes + more, *joined(known.model, found))
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--seed", type=int, default=101)
    given = parser.parse_args()
    case = load_scenario(SCENARIOS / "fast-boat.toml")
    found = []
    for seed in range(given.seed, given.seed + given.trials):
        with tempfile.TemporaryDirectory() as folder:
            found.append(trial(case, Path(folder), seed))
    print(f"{given.trials} trials, root mean squares over them:\n")
    print("| after | minutes | error | stated | ln(error before / error) a minute |")
    print("|---|---|---|---|---|")
    before: tuple[float, float] | None = None
    for stage in found[0]:
        minutes, *sizes = np.sqrt(np.mean(np.array([rows[stage] for rows in found]) ** 2, axis=0)).tolist()
        gain = "" if before is None else f"{np.log(before[1] / sizes[0]) / (minutes - before[0]):.3f}"
        print(f"| {stage} | {minutes:.0f} | {sizes[0]:.3f} | {sizes[1]:.3f} | {gain} |")
        if stage in ("builder's guess", "step trial"):
            before = minutes, sizes[0]
