"""Would the tests notice? Files that prove or measure are changed in one place at a time; some test must fail.

    python tests/benchmarks/mutants.py [--sample 25] [--seed 1] [--only certificate]

Needs `cosmic-ray` of the extra `dev`, which makes the mutants and runs the tests named for each file, on a copy of the
repository. What survives is printed: each is an equivalent change or asks for a test. Annotations and decorators are
not changed.
"""

from __future__ import annotations

import argparse
import random
import shutil
import sqlite3
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = {
    "durations/certificate": (
        "durations_certificate_holds", "durations_criteria_are_certified", "durations_closed_forms",
        "durations_limits_are_kept", "durations_robust_prior_and_recorded", "growing_adds_information",
        "durations_keep_least_information_about_other_parameters",
    ),
    "durations/rounding": (
        "durations_whole_runs_are_the_best", "durations_certificate_holds", "durations_limits_are_kept",
        "durations_keep_least_information_about_other_parameters",
        "durations_nuisance_parameters_are_identifiable_or_merged",
    ),
    "plan/bounds/repositioning": ("plan_bound_holds",),
    "plan/bounds/displacement": ("plan_bound_holds", "plan_bound_branches_on_obstacle_corners"),
    "plan/bounds/branch_and_bound": ("plan_bound_branches_on_obstacle_corners",),
    "plan/verify": (
        "plan_verification_catches_what_is_wrong", "plan_heel_is_checked",
        "plan_information_is_split_by_where_it_comes_from", "plan_whole_days_are_as_accurate_as_stated",
    ),
    "estimation/solve/sandwich": (
        "estimation_agrees_with_econometrics", "estimation_noise_has_parts", "estimation_equation_wise_samples",
    ),
    "reduction/sensors": ("reduction_undoes_what_the_vessel_file_states",),
    "simulation/actuation": (
        "simulation_actuators_deliver_by_closed_forms", "reduction_undoes_what_the_vessel_file_states",
    ),
    "vessel/model": (
        "vessel_regressors_are_the_published_ones", "vessel_priors_keep_to_what_is_known",
        "vessel_actuators_push_where_they_point", "vessel_coupled_inertia_obeys_mechanics",
    ),
    "monitoring/cusum": (
        "monitoring_sums_are_pages", "monitoring_filter_judges_all_stretches_together",
        "monitoring_alarms_are_rare_and_right",
    ),
}  # fmt: skip
"""Files of the package, and the tests that ought to notice."""
TIMEOUT_S = 300.0


def survivors(file: str, tests: tuple[str, ...], repository: Path, sample: int, seed: int) -> tuple[int, list[str]]:
    """How many mutants were tried, and the lines of those that no test noticed."""
    paths = " ".join(f"tests/test_{name}.py" for name in tests)
    (repository / "mutants.toml").write_text(
        f'[cosmic-ray]\nmodule-path = "expdesign/{file}.py"\ntimeout = {TIMEOUT_S}\nexcluded-modules = []\n'
        f'test-command = "{sys.executable} -m pytest -x -q -n 0 -p no:cacheprovider {paths}"\n'
        '[cosmic-ray.distributor]\nname = "local"\n'
    )
    session = repository / "mutants.sqlite"
    session.unlink(missing_ok=True)
    run("init", repository)
    with closing(sqlite3.connect(session)) as base, base:
        found = base.execute("select job_id, operator_name, start_pos_row from mutation_specs").fetchall()
        source = (repository / "expdesign" / f"{file}.py").read_text().splitlines()
        worth = [job for job, operator, row in found if tells(operator, source[row - 1])]
        keep = set(random.Random(seed).sample(sorted(worth), min(sample, len(worth))))
        for job, *_ in found:
            if job not in keep:
                for table in ("mutation_specs", "work_items"):
                    base.execute(f"delete from {table} where job_id = ?", (job,))
    run("exec", repository)
    with closing(sqlite3.connect(session)) as base:
        rows = base.execute(
            "select operator_name, start_pos_row, diff from mutation_specs join work_results using (job_id) "
            "where test_outcome = 'SURVIVED' or test_outcome = 'survived'"
        ).fetchall()
    return len(keep), [f"{row}: {operator}: {changed(diff)}" for operator, row, diff in rows]


def tells(operator: str, line: str) -> bool:
    """Whether a mutant changes a value."""
    name = operator.removeprefix("core/")
    return not (name.startswith(("ReplaceBinaryOperator_BitOr", "RemoveDecorator")) or line.lstrip().startswith("def "))


def changed(diff: str) -> str:
    """The changed line."""
    lines = [line[1:].strip() for line in diff.splitlines() if line.startswith("+") and not line.startswith("+++")]
    return " ".join(lines)[:120]


def run(command: str, repository: Path) -> None:
    program = Path(sys.executable).with_name("cosmic-ray")
    subprocess.run([program, command, "mutants.toml", "mutants.sqlite"], cwd=repository, check=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=25)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="part of a file's name")
    asked = parser.parse_args()
    print("| file | mutants | survive |\n|---|---|---|")
    for file, tests in FILES.items():
        if asked.only not in file:
            continue
        with tempfile.TemporaryDirectory() as folder:
            repository = Path(folder) / "repository"
            shutil.copytree(ROOT, repository, ignore=shutil.ignore_patterns(".*", "__pycache__"))
            count, left = survivors(file, tests, repository, asked.sample, asked.seed)
        print(f"| {file} | {count} | {len(left)} |", *(f"    {line}" for line in left), sep="\n", flush=True)


if __name__ == "__main__":
    main()
