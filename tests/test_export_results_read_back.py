"""What is written is strict, complete, and reads back as the same numbers; files that disagree are refused."""

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import export_case as case
from expdesign.errors import FileError, NoPlan
from expdesign.export.files import commands_csv, dictionary_json, durations_json, plan_json, strict_json, track_csv
from expdesign.export.folder import write_files
from expdesign.export.routes import planned_track, read_plan
from expdesign.simulation import simulate


def strictly(text: str) -> dict[str, object]:
    def refuse(constant: str) -> float:
        raise AssertionError(f"{constant} is not JSON")

    value = json.loads(text, parse_constant=refuse)
    assert isinstance(value, dict)
    return value


def table(text: str) -> dict[str, np.ndarray]:
    rows = list(csv.reader(io.StringIO(text)))
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T, strict=True))


def test_the_dictionary_file_holds_the_matrices_to_the_last_bit() -> None:
    file = strictly(dictionary_json(case.scored(), case.tug().model.names, vessel=case.tug()))
    assert file["parameters"] == list(case.tug().model.names)
    assert file["outputs"] == ["u", "v", "r"]
    for entry, item in zip(file["primitives"], case.scored(), strict=True):
        for name in ("X", "Y", "Z"):
            assert np.array_equal(np.array(entry[name]), getattr(item, name))
        assert (entry["log_det_alone"] is None) == (item.log_det_alone is None)
    gains = [entry["gain_beside_pool"] for entry in file["primitives"]]
    assert sum(gains) == pytest.approx(0.0, abs=1e-6)


def test_the_footprint_of_a_straight_run_reaches_from_its_start_to_a_corner_of_the_bow() -> None:
    file = strictly(dictionary_json(case.scored(), case.tug().model.names, vessel=case.tug()))
    ahead = next(entry for entry in file["primitives"] if entry["name"] == "ahead")
    reach = ahead["displacement"]["forward_m"] + case.tug().length_m / 2
    assert ahead["footprint_radius_m"] == pytest.approx(math.hypot(reach, case.tug().beam_m / 2), rel=1e-12)


def test_the_durations_file_contains_its_certificate() -> None:
    file = strictly(durations_json(case.design()))
    primitives = file["primitives"]
    assert sum(entry["fraction"] for entry in primitives) == pytest.approx(1.0, abs=1e-12)
    assert file["gap"] == pytest.approx(max(e["sensitivity"] for e in primitives) - file["dimension"], abs=1e-12)
    assert file["log_det_bound"] == pytest.approx(file["log_det"] + file["gap"], abs=1e-12)
    assert file["gap_relative"] == pytest.approx(file["gap"] / file["dimension"], abs=1e-15)
    weighted = sum(entry["fraction"] * entry["sensitivity"] for entry in primitives)
    assert weighted == pytest.approx(file["dimension"], rel=1e-9)  # trace(B^-1 B) for the right fractions
    for entry in primitives:
        assert entry["duration_s"] == pytest.approx(entry["fraction"] * file["total_s"], rel=1e-12)


def test_a_missing_certificate_is_null_and_never_nan() -> None:
    file = strictly(durations_json(replace(case.design(), gap=math.inf)))
    assert file["gap"] is file["log_det_bound"] is file["gap_relative"] is None
    with pytest.raises(ValueError, match="not JSON compliant"):
        strict_json({"value": math.nan})


def test_text_in_json_is_unchanged() -> None:
    odd = {"name": "[ 1, 2 ]\n  [3]", "list": [1.5, -2.0], "nested": [[0.1, 1e-30], [2.0, 3.0]], "empty": []}
    assert json.loads(strict_json(odd)) == odd


def test_times_in_the_plan_add_up() -> None:
    file = strictly(case.plan_files()["plan.json"])
    legs = file["legs"]
    assert [leg["index"] for leg in legs] == list(range(len(legs)))
    assert all(one["end"] == two["start"] for one, two in pairwise(legs))
    assert all(("path" in leg) == (leg["kind"] == "reposition") for leg in legs)
    for kind, total in (("primitive", "informative_s"), ("reposition", "reposition_s")):
        assert sum(leg["duration_s"] for leg in legs if leg["kind"] == kind) == pytest.approx(file[total])
    assert file["verified"] is True
    assert file["leave_water_probability"] is None


def test_the_track_lies_where_its_latitudes_and_longitudes_are() -> None:
    track = table(track_csv(case.plan()))
    metres = case.plan().area.frame.to_metres(np.stack([track["lat_deg"], track["lon_deg"]], axis=1))
    assert np.abs(metres - np.stack([track["north_m"], track["east_m"]], axis=1)).max() < 2e-4
    assert np.array_equal(track["time_s"], np.arange(len(case.plan().trajectory)) * 1.0)


def test_times_are_the_decimal_multiples_of_a_sample_time_that_floats_cannot_hold() -> None:
    commands = replace(case.plan().commands, sample_time_s=0.1)
    trajectory = replace(case.plan().trajectory, sample_time_s=0.1)
    text = commands_csv(replace(case.plan(), commands=commands, trajectory=trajectory))
    assert [row.split(",")[0] for row in text.splitlines()[1:9]] == [f"{k / 10}" for k in range(8)]


def test_running_the_written_commands_from_the_first_row_gives_the_written_track(tmp_path: Path) -> None:
    write_files(tmp_path, case.plan_files())
    read = read_plan(tmp_path / "plan.json")
    assert np.array_equal(read.commands.values, case.plan().commands.values)
    assert read.commands.names == case.plan().commands.names
    again = simulate(case.tug(), read.commands, pose=read.trajectory.pose[0], velocity=read.trajectory.velocity[0])
    assert np.abs(again.pose - read.trajectory.pose).max() < 1e-5
    assert np.abs(again.velocity - read.trajectory.velocity).max() < 1e-7


def test_a_plan_reads_back_as_it_was(tmp_path: Path) -> None:
    write_files(tmp_path, case.plan_files())
    read, planned = read_plan(tmp_path / "plan.json"), case.planned()
    assert (read.scenario, read.vessel, read.length_m, read.beam_m) == ("test-sound", "Test tug", 30.0, 10.0)
    assert read.legs == planned.legs
    assert read.frame == planned.frame
    assert read.clearance_m == planned.clearance_m
    assert read.environment.current_std_mps == planned.environment.current_std_mps
    assert np.array_equal(read.sample_leg, case.plan().sample_leg)


def test_a_plan_that_failed_its_checks_is_never_written() -> None:
    values = {"scenario": "s", "vessel": case.tug(), "environment": case.ENVIRONMENT, "clearance_m": 20.0}
    for write in (track_csv, commands_csv, lambda plan: plan_json(plan, **values),
                  lambda plan: planned_track(plan, **values)):  # fmt: skip
        with pytest.raises(NoPlan, match=r"not verified.*3.0 m of the rocks"):
            write(case.unverified())


Edit = Callable[[str], str]


def in_json(**changes: object) -> Edit:
    return lambda text: json.dumps(json.loads(text) | changes)


def in_leg(number: int, **changes: object) -> Edit:
    def edit(text: str) -> str:
        value = json.loads(text)
        value["legs"][number] |= changes
        return json.dumps(value)

    return edit


def in_row(number: int, cell: int, value: str) -> Edit:
    def edit(text: str) -> str:
        rows = [row.split(",") for row in text.splitlines()]
        rows[number - 1][cell] = value
        return "\n".join(map(",".join, rows))

    return edit


@pytest.mark.parametrize(
    ("name", "edit", "message"),
    [
        ("plan.json", in_json(verified=False), "verified: is false"),
        ("plan.json", in_json(sample_time_s=-1), "sample_time_s: is -1: input should be greater than 0"),
        ("plan.json", in_json(sample_time_s=2.0), r"commands.csv: has|track.csv: has|expected a multiple of 2"),
        ("plan.json", in_json(legs=[]), "legs: "),
        ("plan.json", in_json(inputs=["n1"]), "commands.csv: row 1: has the columns"),
        ("plan.json", in_json(frame={"projection": "+proj=merc", "origin": {"lat_deg": 60.1, "lon_deg": 24.9}}),
         "frame.projection"),
        ("plan.json", in_leg(2, index=7), "legs.2.index: is 7, expected 2"),
        ("plan.json", in_leg(2, kind="drift"), "legs.2.kind: is 'drift'"),
        ("plan.json", lambda text: text[: len(text) // 2], "plan.json: is no readable JSON"),
        ("plan.json", lambda text: text.replace('"sample_time_s": 1.0', '"sample_time_s": NaN'), "sample_time_s"),
        ("track.csv", in_row(5, 1, "nan"), "row 5, north_m: is 'nan', expected a number"),
        ("track.csv", in_row(5, 0, "4.5"), "row 5, time_s: is 4.5, expected 3"),
        ("track.csv", in_row(2, 1, "3.0"), "row 2: is not the state that plan.json gives as legs.0.start"),
        ("track.csv", in_row(70, 8, "61.0"), "row 70, lat_deg"),
        ("track.csv", lambda text: text[: text.rindex("\n", 0, -1)], "track.csv: has 900 rows"),
        ("commands.csv", in_row(3, 4, "9"), "row 3, leg: is 9, expected 0"),
        ("commands.csv", in_row(3, 1, "full"), "row 3, tau_x: is 'full', expected a number"),
        ("commands.csv", in_row(3, 4, "0,0"), "row 3: has 6 cells, expected 5"),
        ("commands.csv", lambda _: "", "commands.csv: row 1: has the columns nothing"),
    ],
)  # fmt: skip
def test_files_that_disagree_are_refused_with_the_place(tmp_path: Path, name: str, edit: Edit, message: str) -> None:
    files = case.plan_files()
    write_files(tmp_path, files | {name: edit(files[name])})
    with pytest.raises(FileError, match=message) as caught:
        read_plan(tmp_path / "plan.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["plan.json", "track.csv", "commands.csv"])
def test_a_missing_file_is_named(tmp_path: Path, name: str) -> None:
    write_files(tmp_path, case.plan_files())
    (tmp_path / name).unlink()
    with pytest.raises(FileError, match=f"{name}: does not exist"):
        read_plan(tmp_path / "plan.json")
    (tmp_path / name).write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match=f"{name}: "):
        read_plan(tmp_path / "plan.json")
