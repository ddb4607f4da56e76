"""Plans of a ship with [roll]: the largest heel is that of a simulation, and a limit in her file is kept or refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from design_case import SCENARIOS
from expdesign.errors import NoPlan
from expdesign.export.files import vessel_toml
from expdesign.plan.values import Leg, SailedTrial
from expdesign.plan.verify import verify_plan
from expdesign.scenario import load_vessel
from expdesign.signals import AUXILIARY
from expdesign.simulation import CALM, simulate
from expdesign.vessel import Vessel
from expdesign.workflows import plan
from plan_case import area
from rolling_ship import ROLL_MODEL, UNDER_WAY, roll_model, steps

SHIP = roll_model()


def limited(heel_rad: float) -> Vessel:
    assert SHIP.pendulum is not None
    return replace(SHIP, pendulum=replace(SHIP.pendulum, heel_max_rad=heel_rad))


def heel_problems(ship: Vessel) -> tuple[float | None, list[str]]:
    """Largest heel of a plan of one run, and what is said of it."""
    run = steps(SHIP, samples=500)
    sailed = SailedTrial(
        commands=run.commands,
        trajectory=run.trajectory,
        legs=(Leg(kind="primitive", name=run.name, first=0, last=500),),
    )
    found = verify_plan(
        ship, area(shapely.box(-100, -100, 100, 100)), CALM, sailed, clearance_m=1.0, transit_mps=1.0,
        primitives={run.name: run}, repeats={run.name: 1}, start=np.zeros(3), goal=run.trajectory.pose[-1],
    )  # fmt: skip
    return found.heel_max_rad, [text for text in found.problems if "heel" in text]


def test_the_heel_of_a_plan_is_that_of_a_finer_simulation_and_a_limit_is_checked() -> None:
    finer = simulate(SHIP, steps(SHIP, samples=500).commands, velocity=UNDER_WAY, substeps=10)
    assert finer.auxiliary is not None
    heel = float(np.abs(finer.auxiliary[:, AUXILIARY.index("roll_rad")]).max())
    assert heel > 0.05
    for limit, told in ((np.inf, 0), (1.01 * heel, 0), (0.99 * heel, 1)):
        found, problems = heel_problems(limited(limit))
        assert found == pytest.approx(heel, rel=1e-3)
        assert len(problems) == told
    assert f"she heels by {np.degrees(heel):.1f} deg at" in problems[0]
    assert heel_problems(replace(SHIP, pendulum=None)) == (None, [])


def test_a_limit_survives_the_vessel_file(tmp_path: Path) -> None:
    ship = limited(float(np.radians(12.0)))
    path = tmp_path / "ship.toml"
    path.write_text(vessel_toml(ship))
    again = load_vessel(path).pendulum
    assert again is not None
    assert np.degrees(again.heel_max_rad) == pytest.approx(12.0, rel=1e-12)
    assert load_vessel(ROLL_MODEL).pendulum == SHIP.pendulum


def test_a_run_that_heels_too_much_is_named_before_a_place_is_sought(tmp_path: Path) -> None:
    vessel = tmp_path / "ship.toml"
    vessel.write_text(vessel_toml(limited(float(np.radians(2.0)))))
    first = (SCENARIOS / "dictionaries/roll-model.toml").read_text().split("[[primitives]]\n")[1]
    (tmp_path / "one.toml").write_text(f'[dictionary]\nname = "one"\n\n[[primitives]]\n{first}')
    text = (SCENARIOS / "roll-trial.toml").read_text().replace("vessels/roll-model.toml", str(vessel))
    text = text.replace('"areas/', f'"{SCENARIOS}/areas/').replace("dictionaries/roll-model.toml", "one.toml")
    (tmp_path / "trial.toml").write_text(text)
    with pytest.raises(NoPlan, match=r"u-turn.* heels the ship by .* deg, more than heel_max_deg of \[roll\] .* 2 deg"):
        plan(tmp_path / "trial.toml", tmp_path / "out", cache=False)
