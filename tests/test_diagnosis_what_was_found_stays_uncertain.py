"""What a vessel file states with a standard deviation is refined by data, and wrong only where they contradict it."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis_case import hidden_record, vessel_of
from expdesign.diagnosis import diagnose
from expdesign.diagnosis.data.windows import Windows, cut_windows
from expdesign.diagnosis.fit.fit import Fit
from expdesign.diagnosis.fit.gauss_newton import fit
from expdesign.diagnosis.model.extended_model import ExtendedModel
from expdesign.diagnosis.motion.simulation import initial_states
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.diagnosis.vessel_file.writing import extend
from expdesign.errors import FileError, UnknownName
from expdesign.export.files import vessel_toml
from expdesign.scenario import load_vessel
from expdesign.vessel import Response, Vessel
from measured_trials import prompt
from short_examples import SCENARIOS

TRUE = (0.12, -0.08)
TENDER = SCENARIOS / "vessels/tender-20m.toml"
KEYS = ("current:north", "current:east")


def stating(current: tuple[float, float], std_mps: float) -> Vessel:
    vessel = vessel_of("barge")
    return replace(
        vessel, environment=replace(vessel.environment, current_to=np.array(current), current_std_mps=std_mps)
    )


def fitted(vessel: Vessel, record, free: tuple[str, ...]) -> Fit:
    ship: ExtendedModel = extended_model(vessel, record)
    windows: Windows = cut_windows(ship.model, record)
    return fit(ship, windows, free, starts=initial_states(windows))


def test_a_stated_and_a_measured_current_are_combined_by_their_precisions():
    """The mean of two independent estimates weighted by their precisions; exact in a linear model."""
    record = hidden_record("barge", seed=3, current=TRUE, batches=3, samples=200)
    alone = fitted(stating((0.0, 0.0), 0.0), record, KEYS)
    std = alone.std(KEYS[0])
    stated = {key: alone.value(key) + 1.5 * std for key in KEYS}
    both = fitted(stating(tuple(stated.values()), std), record, ())
    index = [both.keys.index(key) for key in KEYS]
    own = np.linalg.inv(alone.covariance)
    prior = np.eye(2) / std**2
    values = np.array([alone.value(key) for key in KEYS])
    mean = np.linalg.solve(own + prior, own @ values + prior @ np.array(list(stated.values())))
    assert [both.value(key) for key in KEYS] == pytest.approx(mean.tolist(), abs=0.2 * std)
    expected = np.linalg.inv(own + prior)
    assert both.covariance[np.ix_(index, index)] == pytest.approx(expected, abs=0.2 * expected.max())


@pytest.mark.thorough
@pytest.mark.parametrize(("off", "names"), [(0.01, []), (0.15, ["current"])])
def test_a_current_is_found_again_within_its_standard_deviation_and_wrong_beyond_it(off, names):
    record = hidden_record("barge", seed=4, current=TRUE, batches=4, samples=200)
    found = diagnose(stating((TRUE[0] + off, TRUE[1]), 0.01), record)
    assert [item.cause for item in found.findings] == names
    assert any(note.startswith("Found again and refined: north_mps") for note in found.notes) is not bool(names)
    assert 0 < found.extended.environment.current_std_mps < (np.inf if names else 0.01)


def test_standard_errors_of_findings_reach_the_vessel_file_and_come_back(tmp_path):
    """What is written with a standard error is read as uncertain, by the same keys and with the same size."""
    record = hidden_record("tug", seed=1, batches=2, samples=120)
    found = {"current:north": 0.1, "current:east": 0.2, "lag:n": 2.0, "offset:a": 0.03, "heading_bias": 0.02,
             "gyro": 0.04, "lever:forward": 2.0, "late:r": 1.0}  # fmt: skip
    std = {key: 0.1 * abs(value) for key, value in found.items()} | {"current:north": 0.02}
    vessel = prompt(load_vessel(TENDER))
    ship = extended_model(vessel, record).with_effects(found)
    extended, _ = extend(vessel, ship, std)
    file = tmp_path / "vessel.toml"
    file.write_text(vessel_toml(extended), encoding="utf-8")
    again = extended_model(load_vessel(file), record)
    assert again.stated == pytest.approx(found)
    assert again.stated_std == pytest.approx(std)


def test_standard_deviations_are_of_what_the_vessel_has(tmp_path):
    with pytest.raises(UnknownName, match="tau_x_lag_s"):
        replace(vessel_of("tug"), std={"tau_x_lag_s": 0.1})
    text = vessel_toml(replace(load_vessel(TENDER), std={"n1_lag_s": 0.1}))
    file = tmp_path / "vessel.toml"
    file.write_text(text.replace("n1_lag_s", "n1_lags_s"), encoding="utf-8")
    with pytest.raises(FileError, match=r"std: 'n1_lags_s' is no quantity .* 'n1_lag_s'"):
        load_vessel(file)


def test_other_candidates_remain_beside_what_is_uncertain():
    """A lag that is stated with a standard deviation is no finding, so lags of others are still tested."""
    vessel = vessel_of("tug")
    actuators = tuple(replace(one, responses=(Response(lag_s=2.0), Response())) for one in vessel.model.actuators)
    sensors = replace(vessel.sensors, velocity_forward_m=1.0)
    vessel = replace(
        vessel, model=replace(vessel.model, actuators=actuators), sensors=sensors,
        std={"n1_lag_s": 0.2, "n2_lag_s": 0.2, "velocity_forward_m": 0.1},
    )  # fmt: skip
    ship = extended_model(vessel, hidden_record("tug", seed=1, batches=2, samples=120))
    assert ship.stated_std == {"lag:n": 0.2, "lever:forward": 0.1}
    assert not ship.with_effects({"lag:n": 2.1}).has_found("lag:")
    assert ship.with_effects({"lag:a": 2.1}).has_found("lag:")
