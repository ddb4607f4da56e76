"""`new --card` makes a folder of the card's own ship: her vessel file, and her kind's candidates scaled to her."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.errors import InputError
from expdesign.export.files import dictionary_files, toml_value
from expdesign.scenario import load_card, load_scenario, load_vessel
from expdesign.workflows import new, scored
from expdesign.workflows.commands.new import BLOCK, TEMPLATES, _sailable, _scaled, kind_of
from expdesign.workflows.steps.design_problem import designed
from scenario_files import SCENARIOS

CARDS = {path.stem: path for path in (SCENARIOS / "cards").glob("*.toml")}
SHIPS = {path.stem: path for path in (Path(__file__).parent / "benchmarks" / "ships").glob("*.toml")}


@pytest.mark.parametrize(
    "name",
    ["coaster-80m", *(pytest.param(one, marks=pytest.mark.thorough) for one in ("offshore-45m", "otter", "kvlcc2"))],
)
def test_a_folder_of_a_card_designs_a_trial_of_her_own_size(name: str, tmp_path: Path) -> None:
    path = (CARDS | SHIPS)[name]
    case = load_scenario(new(tmp_path / "trial", card=path).files[0])
    assert case.vessel.length_m == load_card(path).hull.length_m
    assert case.remarks == ()  # everything stated acts, and nothing is taken as certain
    width_m, height_m = np.diff(np.reshape(case.area.water.bounds, (2, 2)), axis=0)[0]
    assert 100 < width_m / case.vessel.length_m < 150  # up to 45 km, where maps of the ground are not square
    assert 100 < height_m / case.vessel.length_m < 150
    design = designed(case, scored(case))  # with what the card says, as no trial tells all of her terms apart
    assert design.gap < 0.01
    assert sum(design.repeats) > 0


def test_kinds_follow_from_thrusters_and_rudders() -> None:
    kinds = {name: kind_of(load_card(path)) for name, path in (CARDS | SHIPS).items()}
    others = {
        "otter": "asv",
        "albatross": "asv",
        "macginitie": "azimuth",
        "offshore-45m": "azimuth",
        "naval-vessel": "twin-screw",
        "car-carrier": "twin-screw",
    } | dict.fromkeys(("kvlcc2-model", "kcs-model", "esso-osaka-model"), "model-ship")
    assert kinds == dict.fromkeys(kinds, "propeller-rudder") | others


def test_numbers_are_scaled_by_their_unit_and_nothing_else_is() -> None:
    text = (
        'name = "coaster-80.5m"\n# 3.5 m\nduration_s = 150.0\nspeed_mps = [2.0, 4.0]  # 1.5 of it\nrate_radps = -0.2\n'
        "heading_deg = 60.0\nhold_m = 10.0\ndraw = 1\nhelm_rad = [0.6, -0.6]\nshare = 0.5\n"
        "current_to = { north_mps = 0.1, std_mps = 0.05 }\n"
    )
    size, swift = 4.0, 2.0
    factors = {"_m": size, "_mps": swift, "_s": size / swift, "_radps": swift / size, "helm_rad": 0.5}
    assert _scaled(text, factors) == (
        'name = "coaster-80.5m"\n# 3.5 m\nduration_s = 300.0\nspeed_mps = [4.0, 8.0]  # 1.5 of it\nrate_radps = -0.1\n'
        "heading_deg = 60.0\nhold_m = 40.0\ndraw = 1\nhelm_rad = [0.3, -0.3]\nshare = 0.5\n"
        "current_to = { north_mps = 0.1, std_mps = 0.05 }\n"
    )


def test_a_rudder_that_goes_less_far_turns_her_as_far_as_it_goes(tmp_path: Path) -> None:
    card = tmp_path / "card.toml"
    text = CARDS["coaster-80m"].read_text("utf-8").replace("[[rudders]]\n", "[[rudders]]\nmax_deg = 20.0\n")
    card.write_text(text, "utf-8")
    specs = load_scenario(new(tmp_path / "trial", card=card).files[0]).dictionary
    (circle,) = (spec for spec in specs if spec.name.startswith("circle-helm-0."))
    assert circle.settings["helm_rad"] == pytest.approx(0.6 * 20 / 35, abs=1e-3)


def test_a_ship_may_have_any_name(tmp_path: Path) -> None:
    name = 'MS "Ærø" \\u \N{SHIP}\x7f'
    card = tmp_path / "card.toml"
    text = CARDS["coaster-80m"].read_text("utf-8")
    card.write_text(re.sub(r"^name = .*", lambda _: f"name = {toml_value(name)}", text, count=1, flags=re.M), "utf-8")
    case = load_scenario(new(tmp_path / "trial", card=card).files[0])
    assert case.vessel.name == name
    assert tomllib.loads((tmp_path / "trial" / "dictionary.toml").read_text("utf-8"))["dictionary"]["name"] == name
    files = dictionary_files(case.dictionary[:1], name=name, stem="grown")
    assert tomllib.loads(str(files["grown.toml"]))["dictionary"]["name"] == name


def test_candidates_that_a_ship_cannot_sail_are_left_out_and_named() -> None:
    ship = load_vessel(TEMPLATES / "propeller-rudder" / "vessel.toml")
    text = (TEMPLATES / "propeller-rudder" / "dictionary.toml").read_text("utf-8")
    assert _sailable(text, ship) == (text, ())
    head, stop, *others = text.split(BLOCK)
    fast = re.sub(r"speed_mps = .*", "speed_mps = 20.0", stop)
    kept, (note,) = _sailable(BLOCK.join([head, fast, *others]), ship)
    assert kept == BLOCK.join([head, *others])
    assert "'stop'" in note
    with pytest.raises(InputError, match="none of the template's candidates"):
        _sailable(head + BLOCK + fast, ship)


def test_a_card_that_is_none_is_refused_before_a_folder_is_made(tmp_path: Path, capsys) -> None:
    assert main(["new", str(tmp_path / "trial"), "--card", str(tmp_path / "none.toml"), "--quiet"]) == 2
    assert "none.toml" in capsys.readouterr().err
    assert not (tmp_path / "trial").exists()


@pytest.mark.slow
def test_the_card_of_a_ship_whose_thrusters_do_not_reverse_leads_to_a_verified_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """80 s of processor."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "osv", "--card", str(CARDS["offshore-45m"]), "--quiet"]) == 0
    assert main(["run", "osv/scenario.toml", "--out", "plan", "--quiet"]) == 0
    assert json.loads(Path("plan/plan.json").read_text("utf-8"))["verified"] is True
