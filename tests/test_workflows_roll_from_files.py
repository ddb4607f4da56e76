"""`expdesign roll`: from CSV files at several loads to parameters, null space, JSON and page."""

import json
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import FileError, InputError, UnknownName
from expdesign.roll import NOMINAL, PARAMETERS
from expdesign.workflows import roll
from roll_files import K_KNOWN, KNOWN, SHIP, UNKNOWN, csv, stated, three
from roll_truths import MODEL_SHIP_TRUTH

pytestmark = pytest.mark.usefixtures("undrawn")


def truth(name: str) -> float:
    return float(MODEL_SHIP_TRUTH[PARAMETERS.index(name)])


def test_three_files_give_the_load_and_say_what_they_do_not_tell(tmp_path: Path) -> None:
    loads = stated(tmp_path, "\n[[load]]\n" + KNOWN + UNKNOWN)
    outcome = roll(three(tmp_path), tmp_path / "out", loads=loads)
    assert {path.name for path in outcome.files} == {"roll.json", "roll.html"}
    found = json.loads((tmp_path / "out" / "roll.json").read_text())
    mass = found["parameters"]["m"]
    assert abs(mass["value"] - truth("m")) < 4 * mass["std"] < 0.4
    assert found["null_space"]["rank"] == 8
    assert found["parameters"]["k"]["std"] is None
    assert not found["parameters"]["k"]["determined"]
    assert (found["intervals_trusted"], found["reached_bounds"]) == (True, [])
    page = (tmp_path / "out" / "roll.html").read_text()
    assert "The load cases determine 8 of 9 parameters, whatever the data are. k was held at the start value." in page
    assert "measure how far the accelerometer is from the rotation axis" in page


@pytest.mark.thorough
def test_with_k_known_all_else_is_found_of_the_model_and_by_froude_s_law_of_the_ship(tmp_path: Path) -> None:
    loads = stated(tmp_path, "\n[[load]]\n" + KNOWN + UNKNOWN + K_KNOWN)
    outcome = roll(three(tmp_path), tmp_path / "out", loads=loads, scale=24.0)
    found = outcome.summary
    assert (found["of_these_determined"], found["parameters_sought"], found["held"]) == (8, 8, [])
    assert "wrong sign" not in str(outcome.document)
    values, stds = found["parameters"], found["std"]
    assert isinstance(values, dict)
    assert isinstance(stds, dict)
    for name, std in stds.items():
        assert abs(values[name] - truth(name)) < 4 * std, name
    _told_by_froude(tmp_path / "out")
    with pytest.raises(InputError, match="--scale is 0, expected more than 0"):
        roll(three(tmp_path), tmp_path / "none", loads=loads, scale=0.0)


def _told_by_froude(out: Path) -> None:
    """A model tells of a ship 24 times as long."""
    found = json.loads((out / "roll.json").read_text())
    for name, power in {"A_x": 5.0, "d": 4.5, "K_r": 4.5, "K_vd": 4.0, "K_delta": 4.0, "z_f": 1.0, "m": 3.0}.items():
        model, ship = found["parameters"][name], found["at_full_scale"][name]
        for key in ("value", "std"):
            assert ship[key] == pytest.approx(24.0**power * model[key], rel=1e-12)
    page = (out / "roll.html").read_text()
    assert "24 times as long as her model" in page
    assert f"{24.0**3 * found['parameters']['m']['value']:.4g}" in page


@pytest.mark.thorough
def test_a_wrong_sign_of_the_accelerometer_is_named(tmp_path: Path) -> None:
    files, loads = three(tmp_path), stated(tmp_path, "\n[[load]]\n" + KNOWN + UNKNOWN + K_KNOWN)
    for path in files:
        table = np.genfromtxt(path, delimiter=",", names=True)
        table["imu_lateral_mps2"] *= -1.0
        names = ",".join(table.dtype.names or ())
        np.savetxt(
            path, np.column_stack([table[n] for n in names.split(",")]), delimiter=",", header=names, comments=""
        )
    notes = roll(files, tmp_path / "out", loads=loads).document.all_notes
    assert "imu_lateral_mps2 or roll_rate_radps seems to have the wrong sign" in str(notes)
    assert "wrong sign" in (tmp_path / "out" / "roll.html").read_text()


@pytest.mark.thorough
def test_planned_rudders_are_instruments_and_said_to_be(tmp_path: Path) -> None:
    loads = stated(tmp_path, "\n[[load]]\n" + KNOWN + UNKNOWN + K_KNOWN)
    files = three(tmp_path)
    for path in files:
        head, *rows = path.read_text().splitlines()
        planned = [row + f",{float(row.split(',')[-1]) * 0.5:.9g},1" for row in rows]
        path.write_text("\n".join([head + ",planned_rudder1_rad,steered", *planned]) + "\n")
    roll(files, tmp_path / "out", loads=loads)
    planned_told = json.loads((tmp_path / "out" / "roll.json").read_text())
    assert any("Instruments come from the rudder as planned" in note for note in planned_told["notes"])
    for name in ("A_x", "m"):
        assert (
            abs(planned_told["parameters"][name]["value"] - truth(name)) < 4 * planned_told["parameters"][name]["std"]
        )
    for path in files:
        lines = [line.split(",") for line in path.read_text().splitlines()]
        path.write_text("\n".join(",".join([*line[:5], line[6]]) for line in lines) + "\n")
    roll(files, tmp_path / "out", loads=loads)
    told = json.loads((tmp_path / "out" / "roll.json").read_text())
    assert any("Samples are marked as steered" in note for note in told["notes"])


@pytest.mark.thorough
def test_a_parameter_at_a_bound_of_the_search_is_named_on_page_and_in_file(tmp_path: Path) -> None:
    far = K_KNOWN.replace("9.0", "40.0")
    loads = stated(tmp_path, "\n[[load]]\n" + KNOWN + UNKNOWN + far)
    roll(three(tmp_path), tmp_path / "out", loads=loads, method="ls")
    found = json.loads((tmp_path / "out" / "roll.json").read_text())
    page = (tmp_path / "out" / "roll.html").read_text()
    assert found["reached_bounds"]
    for name in found["reached_bounds"]:
        assert f"{name} stands at a bound of the search, {found['parameters'][name]['value']:.4g} " in page
    assert not found["intervals_trusted"]
    assert "The 95 % intervals are not to be trusted" in page


@pytest.mark.thorough
def test_one_file_gives_five_parameters_and_two_give_seven(tmp_path: Path) -> None:
    text = f"\n[known]\nK_vd = {truth('K_vd')}\nz_f = {truth('z_f')}\n"
    files = three(tmp_path)
    one = roll(files[:1], tmp_path / "one", loads=stated(tmp_path, "\n[[load]]\n" + text)).summary
    assert (one["of_these_determined"], one["parameters_sought"]) == (5, 5)
    two = roll([files[0], files[2]], tmp_path / "two", loads=stated(tmp_path, "\n[[load]]\n" + UNKNOWN + text)).summary
    assert (two["of_these_determined"], two["parameters_sought"]) == (7, 7)
    for found in (one, two):
        values, stds = found["parameters"], found["std"]
        assert isinstance(values, dict)
        assert isinstance(stds, dict)
        for name, std in stds.items():
            assert abs(values[name] - truth(name)) < 4 * std, name


def test_wrong_inputs_are_one_line_and_leave_nothing(tmp_path: Path) -> None:
    files, out = three(tmp_path), tmp_path / "out"
    with pytest.raises(InputError, match=r"load: has 1 load cases for 3 data files, expected one each"):
        roll(files, out, loads=stated(tmp_path, "\n[[load]]\n"))
    with pytest.raises(FileError, match=r"load\[1\]: is unknown = true and states a load"):
        roll(files[:1], out, loads=stated(tmp_path, "\n[[load]]\nunknown = true\nmass_kg = 1.0\n"))
    with pytest.raises(FileError, match=r"known: is 'K_v', "):
        roll(files[:1], out, loads=stated(tmp_path, "\n[[load]]\n\n[known]\nK_v = 1.0\n"))
    both = "\n[known]\nk = 9.0\n\n[start]\nk = 8.0\n"
    with pytest.raises(FileError, match=r"start\.k: is also under \[known\], expected it under one of"):
        roll(files[:1], out, loads=stated(tmp_path, "\n[[load]]\n" + both))
    with pytest.raises(InputError, match=r"nominal\.csv: is given more than once, expected each data file once"):
        roll([files[0], files[0]], out, loads=stated(tmp_path, "\n[[load]]\n" + KNOWN))
    with pytest.raises(FileError, match=r"is not valid TOML: .*overwrite"):
        roll(files[:1], out, loads=stated(tmp_path, "\n[[load]]\n\n[known]\nk = 9.0\nk = 8.0\n"))
    path = tmp_path / "flat.toml"
    path.write_text(SHIP.replace("beam_m = 0.3", "beam_m = 0.0") + "\n[[load]]\n")
    with pytest.raises(FileError, match=r"ship\.beam_m: is 0, expected more than 0"):
        roll(files[:1], out, loads=path)
    bare = csv(tmp_path / "bare.csv", NOMINAL, 1, without="imu_lateral_mps2")
    with pytest.raises(InputError, match=r"bare\.csv: imu_lateral_mps2: is missing"):
        roll([bare], out, loads=stated(tmp_path, "\n[[load]]\n"))
    with pytest.raises(UnknownName, match="unknown rudder signal 'rudder2'"):
        roll(files[:1], out, loads=stated(tmp_path, "\n[[load]]\n"), rudder=["rudder2"])
    with pytest.raises(InputError, match=r"the low-pass filter of 0\.4 Hz leaves"):
        roll(files[:1], out, loads=stated(tmp_path, "\n[[load]]\n"), lowpass_hz=0.4)
    assert not out.exists()
