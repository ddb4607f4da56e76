"""What the excitation condition is worth: bias of instrumental variables from designs without it and with it.

`python tests/benchmarks/excitation.py [--trials N]`: the 30 m ship without wind and current, with noisy velocities,
sails the optimal whole runs of the standard manoeuvres, estimated from all samples, and those of manoeuvres with an
offset under excitation = "required", estimated from equation-wise samples. Bias is told in standard errors of its mean
over the trials; beyond chance are parameters above the limit of 1 % for all together. Deviations are those predicted of
either design, as a ratio to the first one's: what the condition costs.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.dictionary import build_dictionary
from expdesign.durations import build_durations, solve_durations
from expdesign.durations.criteria import Aim
from expdesign.export.validation_page import surely_biased
from expdesign.information import estimated_parameters, score_primitives
from expdesign.rehearsal import Rehearsal, Validated, validate
from expdesign.scenario import load_vessel
from expdesign.scenario.dictionaries import load_dictionary
from expdesign.simulation import CALM
from expdesign.vessel import Sensors, Vessel
from shared_work import add_sharing, shared_work

ROOT = Path(__file__).parents[2] / "scenarios"
TOTAL_S = 3600.0
NOISE_MPS = 0.05
WAYS = (("standard", "free"), ("offset-azimuth-30m", "free"), ("offset-azimuth-30m", "required"))


def ship() -> Vessel:
    """The true ship, which simulates the instruments, too, with noisy velocities."""
    true = load_vessel(ROOT / "vessels/azimuth-30m-true.toml")
    return replace(true, sensors=Sensors(velocity_mps=NOISE_MPS, yaw_rate_radps=0.005, heading_rad=0.005))


def tried(dictionary: str, excitation: str, *, trials: int, seed: int) -> Validated:
    """The optimal design of a dictionary in simulated trials."""
    vessel = ship()
    fixed = [name for name in vessel.model.names if name.startswith("W_")]
    names = estimated_parameters(vessel.model, fixed)
    primitives = build_dictionary(vessel, load_dictionary(ROOT / f"dictionaries/{dictionary}.toml"))
    information = score_primitives(vessel, primitives, fixed_parameters=fixed, excitation=excitation)
    aim = Aim(criterion="D_s", interest=names)
    design = solve_durations(build_durations(information, names, total_s=TOTAL_S, aim=aim, excitation=excitation))
    rehearsal = Rehearsal(
        truth=vessel,
        nominal=vessel,
        primitives=primitives,
        designs={"optimised": design.repeats},
        total_s=TOTAL_S,
        environment=CALM,
        parameters=names,
        excitation=excitation,
        integrator="euler",
        trials=trials,
        seed=seed,
    )
    (found,) = validate(rehearsal)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    add_sharing(parser)
    chosen = parser.parse_args()
    print("| manoeuvres | excitation | largest bias | beyond chance | intervals hold | failed | deviations |")
    print("|---|---|---|---|---|---|---|")
    first: np.ndarray | None = None
    with shared_work(chosen):
        for dictionary, excitation in WAYS:
            found = tried(dictionary, excitation, trials=chosen.trials, seed=chosen.seed)
            first = found.theory if first is None else first
            worst = int(np.argmax(found.bias_deviations))
            ratio = float(np.exp(np.mean(np.log(found.theory / first))))
            print(
                f"| {dictionary} | {excitation} | {found.bias_deviations[worst]:.1f} ({found.parameters[worst]}) "
                f"| {', '.join(surely_biased(found)) or 'none'} | {100 * found.coverage.mean():.1f} % | {found.failed} "
                f"| {ratio:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
