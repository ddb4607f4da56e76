"""A stated slew rate acts between order and delivery in every command that reads data, whatever a record holds.

Data are of `synthetic_ship`, which shares no code with the package.
"""

import json
from pathlib import Path

import pytest

from expdesign import workflows
from synthetic_ship import TRUTH, sail, trial, vessel_file, voyage, write

pytestmark = pytest.mark.usefixtures("undrawn")

HOLDS = {
    "orders": {},
    "positions": {"rudder1_rad": "", "reached": "reached_rudder1_rad"},
    "both": {"reached": "reached_rudder1_rad"},
}
"""What a record holds -> names of its columns."""
ORDERS, POSITIONS, *_ = map(str, range(len(HOLDS)))


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, sailed = tmp_path_factory.mktemp("slewing"), sail(trial())
    for number, names in enumerate(HOLDS.values()):
        write(folder / f"{number}.csv", sailed, **names)
    for name, rate in {"stated": 0.05, "slow": 0.03, "none": None}.items():
        vessel_file(folder / f"{name}.toml", rate=rate)
    vessel_file(folder / "unsure.toml", rate=0.035, extra="[std]\nrudder1_rate = 0.015\n")
    return folder


def estimated(files: Path, data: str, vessel: str, *methods: str) -> dict[str, dict]:
    """Method -> its part of estimate.json."""
    out = files / f"{data}-{vessel}"
    workflows.estimate(
        [files / f"{data}.csv"], out, vessel=files / f"{vessel}.toml", methods=list(methods), mean="none"
    )
    return json.loads((out / "estimate.json").read_text("utf-8"))


@pytest.mark.thorough
def test_estimates_hold_the_truth_whatever_the_record_holds(files: Path):
    found = {holds: estimated(files, str(number), "stated", "ls", "oe") for number, holds in enumerate(HOLDS)}
    for holds, by_method in found.items():
        for method, content in by_method.items():
            for name in ("N_ud", "N_ur"):
                value, std = content["parameters"][name].values()
                assert abs(value - TRUTH[name]) < 4 * std, (holds, method, name)
                assert std < 0.02 * abs(value)
                assert abs(value - found["positions"][method]["parameters"][name]["value"]) < std, (holds, method, name)
    for method, content in estimated(files, ORDERS, "none", "ls", "oe").items():
        assert content["parameters"]["N_ud"]["value"] < 0.7 * TRUTH["N_ud"], method


@pytest.mark.thorough
def test_positions_under_the_name_of_orders_are_not_slewed_again(files: Path):
    """Read at the samples and held from there, they come half a sample late, and nothing more."""
    write(files / "held.csv", sail(trial()), rudder1_rad="", reached="rudder1_rad")
    stated, none = (estimated(files, "held", vessel, "oe")["oe"]["parameters"] for vessel in ("stated", "none"))
    assert stated == none
    assert stated["N_ud"]["value"] == pytest.approx(TRUTH["N_ud"], rel=0.05)


def test_an_uncertain_rate_is_estimated_with_the_parameters(files: Path):
    """Stated is 0.035 +- 0.015 rad/s, the truth 0.05."""
    content = estimated(files, ORDERS, "unsure", "oe")["oe"]
    for name in ("N_ud", "N_ur"):
        value, std = content["parameters"][name].values()
        assert abs(value - TRUTH[name]) < 4 * std, name
    rate = content["nuisance"]["rudder1_rate"]
    assert abs(rate["value"] - 0.05) < 4 * rate["std"]
    assert rate["std"] < 0.003


def diagnosed(files: Path, data: str, vessel: str) -> list[dict]:
    out = files / f"found-{data}-{vessel}"
    workflows.diagnose([files / f"{data}.csv"], out, vessel=files / f"{vessel}.toml")
    return json.loads((out / "diagnosis.json").read_text("utf-8"))["findings"]


@pytest.mark.thorough
@pytest.mark.parametrize("data", [ORDERS, POSITIONS])
def test_the_true_ship_has_no_faults(files: Path, data: str):
    assert not diagnosed(files, data, "stated")


@pytest.mark.thorough
def test_a_wrong_rate_is_named_and_the_right_one_written(files: Path):
    assert diagnosed(files, ORDERS, "slow")[0]["cause"] == "actuator_slew"
    text = (files / f"found-{ORDERS}-slow" / "vessel-extended.toml").read_text("utf-8")
    written = next(float(line.split("=")[1]) for line in text.splitlines() if line.startswith("angle_rate_radps"))
    assert written == pytest.approx(0.05, rel=0.04)


@pytest.mark.thorough
def test_a_watch_on_orders_is_silent_for_the_same_ship_and_finds_less_thrust(files: Path):
    seas = {"known": (1, {}), "same": (2, {}), "weaker": (3, {"X_nn": 0.92 * TRUTH["X_nn"]})}
    for name, (seed, truth) in seas.items():
        write(files / f"{name}.csv", sail(voyage(4500, seed=seed), **truth), seed=seed)
    how = {"vessel": files / "stated.toml", "reference": [files / "known.csv"]}
    for name in ("same", "weaker"):
        workflows.monitor([files / f"{name}.csv"], files / name, **how)
    same, weaker = (json.loads((files / name / "monitor.json").read_text("utf-8")) for name in ("same", "weaker"))
    assert not same["alarms"]
    assert weaker["alarms"][0]["effect"] == "theta:X_nn"
