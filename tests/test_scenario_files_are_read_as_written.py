import math
import re

import numpy as np
import pytest

from expdesign.dictionary import Family, Setting
from expdesign.errors import FileError
from expdesign.plan.values import PlanSettings
from expdesign.scenario import load_dictionary, load_scenario, load_vessel
from expdesign.vessel import column_name
from scenario_files import spoil, write_scenario


def test_everything_arrives_in_si_units_and_radians(tmp_path):
    scenario = load_scenario(write_scenario(tmp_path))
    assert scenario.name == "square"
    np.testing.assert_allclose(scenario.start, [200.0, -400.0, math.pi / 2])
    np.testing.assert_allclose(scenario.goal, [0.0, 0.0045 * 111_319.4908, 0.0], atol=1e-3)
    np.testing.assert_array_equal(scenario.environment.current_to, [0.1, 0.0])
    np.testing.assert_array_equal(scenario.environment.wind_to, [3.0, -2.0])
    assert (scenario.environment.current_std_mps, scenario.environment.wind_std_mps) == (0.05, 0.0)
    assert scenario.design.total_s == 600.0
    assert scenario.design.mean_subtraction == "complete"
    assert scenario.plan == PlanSettings(clearance_m=20.0, confidence=0.9)


def test_what_is_not_given_stays_at_its_default(tmp_path):
    path = write_scenario(tmp_path)
    text = path.read_text(encoding="utf-8")
    path.write_text("\ufeff" + text[: text.index("[environment]")].replace('name = "square"', ""), encoding="utf-8")
    scenario = load_scenario(path)
    assert scenario.name == "scenario"
    assert scenario.plan == PlanSettings()
    assert scenario.environment.isotropic


@pytest.mark.parametrize("east_m", [-830.0, -810.0, -1000.0, 5000.0])
@pytest.mark.parametrize("degrees", [False, True])
def test_the_place_an_error_offers_is_accepted(tmp_path, east_m, degrees):
    path = write_scenario(tmp_path)
    bad = f"lat_deg = 0.001\nlon_deg = {east_m / 111_319.49}" if degrees else f"north_m = 200\neast_m = {east_m}"
    spoil(path, "north_m = 200\neast_m = -400.0", bad)
    with pytest.raises(FileError) as caught:
        load_scenario(path)
    offered = re.search(
        r"the nearest place with room and a way to the goal is (\w+ = \S+), (\w+ = \S+)$", str(caught.value)
    )
    spoil(path, bad, f"{offered[1]}\n{offered[2]}")
    load_scenario(path)


def test_signal_names_never_clash(tmp_path):
    """Propellers of all kinds share one count; rudders have their own."""
    write_scenario(tmp_path)
    path = tmp_path / "vessel.toml"
    more = '[[actuators]]\nkind = "rudder"\nangle_min_rad = -0.6\nangle_max_rad = 0.6\n'
    more += (
        '[[actuators]]\nkind = "azimuth"\nspeed_min_rps = 0\nspeed_max_rps = 5\nangle_min_rad = -1\nangle_max_rad = 1\n'
    )
    spoil(path, "[model]", f"{more}[model]")
    vessel = load_vessel(path)
    assert vessel.model.inputs == ("n1", "a1", "n2", "rudder1", "n3", "a3")
    assert [column_name(name) for name in vessel.model.inputs][3:5] == ["rudder1_rad", "n3_rps"]
    assert [limit.low for limit in vessel.limits] == [-15.0, -math.inf, -10.0, -0.6, 0.0, -1.0]
    assert vessel.rates.tolist()[:3] == [1.5, 0.25, math.inf]


def test_parameters_go_by_name_not_by_order(tmp_path):
    write_scenario(tmp_path)
    path = tmp_path / "vessel.toml"
    before = load_vessel(path).model
    spoil(path, "X_u = -0.2\nX_abs_u_u = -0.05", "X_abs_u_u = -0.05\nX_u = -0.2")
    after = load_vessel(path).model
    np.testing.assert_array_equal(before.parameters, after.parameters)
    assert dict(zip(after.names, after.parameter_std, strict=True)) == {
        "X_u": 0.06,
        "X_abs_u_u": 0.0,
        "W_abs_u_u": 0.0,
        "X_mu": 0.0,
    }


def test_a_built_in_structure_written_out_as_custom_terms_is_the_same_model(tmp_path):
    write_scenario(tmp_path)
    path = tmp_path / "vessel.toml"
    built_in = load_vessel(path).model
    terms = "".join(
        f'[[model.terms]]\nequation = "u"\nname = "{term.name}"\nexpression = "{term.expression}"\n'
        for term in built_in.terms
    )
    spoil(path, 'structure = "surge"', 'structure = "custom"')
    spoil(path, "[sensors]", terms + "[sensors]")
    custom = load_vessel(path).model
    state = (1.3, 0.2, 0.01), (0.8, -0.4), (5.0, 0.3, -2.0)
    assert custom.accelerations(*state) == built_in.accelerations(*state)


FAMILY = Family(
    name="box",
    summary="for the test",
    settings=(
        Setting(name="duration_s", meaning="length"),
        Setting(name="speed_mps", meaning="speed", low=-5.0, high=5.0),
        Setting(name="lean", meaning="optional", default=0.5),
    ),
    reference=lambda settings, time_s: np.zeros((len(time_s), 3)),
)


def _dictionary(tmp_path, body):
    path = tmp_path / "grid.toml"
    path.write_text(f'[dictionary]\nname = "grid"\n{body}', encoding="utf-8")
    return load_dictionary(path, families=(FAMILY,))


def test_lists_make_every_combination_with_unique_deterministic_names(tmp_path):
    body = '[[primitives]]\nfamily = "box"\nduration_s = [60, 90.5]\nspeed_mps = [-1, 1e-3, 2]\n'
    specs = _dictionary(tmp_path, body)
    expected = [(60.0, -1.0), (60.0, 0.001), (60.0, 2.0), (90.5, -1.0), (90.5, 0.001), (90.5, 2.0)]
    assert [(spec.settings["duration_s"], spec.settings["speed_mps"]) for spec in specs] == expected
    assert all(spec.settings["lean"] == 0.5 and spec.family == "box" for spec in specs)
    assert specs[1].name == "box-duration-60-speed-0.001"
    assert len({spec.name for spec in specs}) == 6
    assert specs == _dictionary(tmp_path, body)
    assert all(re.fullmatch(r"[\w.-]+", spec.name) for spec in specs)


def test_numbers_that_differ_have_names_that_differ(tmp_path):
    specs = _dictionary(
        tmp_path, '[[primitives]]\nfamily = "box"\nduration_s = 1\nspeed_mps = [0.123456789, 0.123456788]\n'
    )
    assert specs[0].name != specs[1].name


def test_unnamed_entries_of_one_family_are_counted(tmp_path):
    entry = '[[primitives]]\nfamily = "box"\nduration_s = 60\nspeed_mps = 1\n'
    named = entry.replace("[[primitives]]\n", '[[primitives]]\nname = "mine"\n').replace(
        "speed_mps = 1", "speed_mps = [1]"
    )
    names = [spec.name for spec in _dictionary(tmp_path, entry + entry + named)]
    assert names == ["box", "box-2", "mine-speed-1"]


def test_a_grid_too_large_to_be_meant_is_refused(tmp_path):
    grid = f"lean = {list(range(500))}\nduration_s = {list(range(1, 101))}\nspeed_mps = 1\n"
    with pytest.raises(FileError, match="makes 50000 primitives, expected at most 10000"):
        _dictionary(tmp_path, f'[[primitives]]\nfamily = "box"\n{grid}')
