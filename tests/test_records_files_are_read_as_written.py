"""What a file says arrives in SI units and in batches; what is dealt with on the way is noted."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from expdesign.conventions import OUTPUTS
from expdesign.records import load_records
from expdesign.signals import Batch, Record
from record_files import SAMPLE_TIME_S, csv_text, motion, texts, write_trial

Data = dict[str, np.ndarray]
KNOT = 1852 / 3600


def loaded(path: Path, data: Data) -> Record:
    return load_records(write_trial(path / "trial.csv", data))


def only(record: Record) -> Batch:
    (batch,) = record.batches
    return batch


def same(a: Batch, b: Batch, tolerance: float = 1e-12) -> bool:
    """Whether two batches hold the same numbers."""
    pairs = [(getattr(a, name), getattr(b, name)) for name in ("inputs", "velocity", "pose", "wind", "depth_m")]
    return a.sample_time_s == b.sample_time_s and all(
        x.shape == y.shape and np.allclose(x, y, rtol=tolerance, atol=tolerance) for x, y in pairs
    )


def test_every_column_arrives_as_it_was_written(tmp_path: Path) -> None:
    data = motion()
    record = loaded(tmp_path, data)
    batch = only(record)
    assert (record.notes, batch.name, batch.first_row, batch.sample_time_s) == ((), "trial.csv", 2, SAMPLE_TIME_S)
    assert batch.input_names == ("n1", "rudder1")
    for index, name in enumerate(("n1_rps", "rudder1_rad")):
        assert np.array_equal(batch.inputs[:, index], data[name])
    for index, names in enumerate((("u_mps", "north_m"), ("v_mps", "east_m"), ("r_radps", "heading_rad"))):
        assert np.array_equal(batch.velocity[:, index], data[names[0]])
        assert np.array_equal(batch.pose[:, index], data[names[1]])
    speed, angle = data["wind_speed_mps"], data["wind_angle_rad"]
    assert np.allclose(batch.wind, np.stack([speed * np.cos(angle), speed * np.sin(angle)], axis=-1), rtol=1e-15)
    assert np.array_equal(batch.depth_m, data["depth_m"])


def test_a_headwind_makes_the_ship_move_forward_through_the_air(tmp_path: Path) -> None:
    data = motion()
    ahead = loaded(tmp_path, data | {"wind_angle_rad": 0 * data["wind_angle_rad"]})
    assert np.allclose(only(ahead).wind, np.stack([data["wind_speed_mps"], 0 * data["wind_speed_mps"]], axis=-1))
    starboard = loaded(tmp_path, data | {"wind_angle_rad": 0 * data["wind_angle_rad"] + np.pi / 2})
    assert (only(starboard).wind[:, 1] > 4).all()


UNITS: dict[str, tuple[str, float, str]] = {
    "time_s": ("time_ms", 1e-3, "time_ms is read as time_s, times 0.001"),
    "u_mps": ("u_knots", KNOT, "u_knots is read as u_mps, times 0.514444"),
    "v_mps": ("v [kn]", KNOT, "v [kn] is read as v_mps, times 0.514444"),
    "r_radps": ("r_degps", np.pi / 180, "r_degps is read as r_radps, times 0.0174533"),
    "heading_rad": ("heading_deg", np.pi / 180, ""),
    "n1_rps": ("n1_rpm", 1 / 60, "n1_rpm is read as n1_rps, times 0.0166667"),
    "rudder1_rad": ("rudder_deg", np.pi / 180, "rudder_deg is read as rudder1_rad, times 0.0174533"),
    "wind_speed_mps": ("wind_speed_knots", KNOT, "wind_speed_knots is read as wind_speed_mps, times 0.514444"),
    "wind_angle_rad": ("wind_angle_deg", np.pi / 180, "wind_angle_deg is read as wind_angle_rad, times 0.0174533"),
    "north_m": ("NORTH_M", 1.0, "NORTH_M is read as north_m"),
    "depth_m": ("depth (cm)", 0.01, "depth (cm) is read as depth_m, times 0.01"),
}


@pytest.mark.parametrize("name", UNITS)
def test_known_quantities_in_other_units_are_converted_and_noted(tmp_path: Path, name: str) -> None:
    other, factor, note = UNITS[name]
    data = motion()
    renamed = {other if n == name else n: v / factor if n == name else v for n, v in data.items()}
    record = loaded(tmp_path, renamed)
    assert same(only(record), only(loaded(tmp_path, data)))
    assert record.notes == ((f"trial.csv: {note}",) if note else ())


def test_latitudes_become_metres_from_the_first_position_of_the_first_file(tmp_path: Path) -> None:
    data = motion()
    lat = 60 + np.linspace(0, 0.01, len(data["time_s"]))
    place = {n: v for n, v in data.items() if n not in ("north_m", "east_m", "u_mps", "v_mps", "r_radps")}
    first = write_trial(tmp_path / "a.csv", place | {"lat_deg": lat, "lon_deg": 25 + 0 * lat})
    second = write_trial(tmp_path / "b.csv", place | {"lat_deg": lat, "lon_deg": 25.01 + 0 * lat})
    record = load_records([first, second], velocity="smoothed")
    north, east = record.batches[0].pose[:, 0], record.batches[1].pose[0, 1]
    assert np.abs(north - 111_412 * (lat - 60)).max() < 0.1  # length of a degree of latitude there, WGS84
    assert east == pytest.approx(0.01 * 55_800, rel=1e-3)  # and of longitude
    assert record.notes[0] == "a.csv and 1 more file: north_m and east_m are metres from lat_deg 60, lon_deg 25"


def test_a_track_over_the_date_line_is_continuous(tmp_path: Path) -> None:
    data = motion()
    lon = 179.9999 + 1e-5 * np.arange(len(data["time_s"]))
    lon = np.where(lon > 180, lon - 360, lon)
    names = ("time_s", "heading_rad", "n1_rps")
    place = {name: data[name] for name in names} | {"lat_deg": 0 * lon + 10, "lon_deg": lon}
    step = np.diff(only(loaded(tmp_path, place)).pose[:, 1])
    assert np.allclose(step, 1e-5 * 109_639, rtol=1e-3)


def test_metres_go_before_degrees_and_radians_before_degrees(tmp_path: Path) -> None:
    data = motion()
    more = {"lat_deg": 60 + data["north_m"], "lon_deg": data["east_m"], "heading_deg": 57.3 * data["heading_rad"]}
    record = loaded(tmp_path, data | more)
    assert same(only(record), only(loaded(tmp_path, data)))
    assert record.notes == ("trial.csv: ignored lat_deg, lon_deg, heading_deg",)


def test_columns_that_mean_nothing_here_are_ignored_whatever_they_hold(tmp_path: Path) -> None:
    columns = texts(motion())
    columns["thrust1_N"] = ["x"] * 80
    columns["leg"] = ['"turn, to port"'] * 80
    columns['"true\nwind"'] = ["1"] * 80
    columns[""] = [""] * 80
    path = tmp_path / "trial.csv"
    path.write_text(csv_text(columns), encoding="utf-8")
    record = load_records(path)
    assert record.notes == ("trial.csv: ignored thrust1_N, leg, true wind, column 16",)
    assert same(only(record), only(loaded(tmp_path, motion())))


FORMS: dict[str, Callable[[str], bytes]] = {
    "byte-order mark": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "carriage returns": lambda text: text.replace("\n", "\r\n").encode(),
    "old Macintosh": lambda text: text.replace("\n", "\r").encode(),
    "blank lines at the end": lambda text: (text + "\n\n").encode(),
    "no newline at the end": lambda text: text.rstrip("\n").encode(),
    "blanks around": lambda text: text.replace(",", " , ").encode(),
    "quoted": lambda text: '"{}"\n'.format(text.strip().replace(",", '","').replace("\n", '"\n"')).encode(),
}


@pytest.mark.parametrize("form", FORMS)
def test_the_form_of_the_text_does_not_matter(tmp_path: Path, form: str) -> None:
    path = tmp_path / "trial.csv"
    path.write_bytes(FORMS[form](csv_text(texts(motion()))))
    record = load_records(path)
    assert record.notes == ()
    assert same(only(record), only(loaded(tmp_path, motion())), tolerance=0)


def test_missing_numbers_at_both_ends_are_cut_and_noted(tmp_path: Path) -> None:
    data = motion()
    data["u_mps"][75:] = np.nan
    data["heading_rad"][78:] = np.nan
    data["north_m"][:3] = np.nan
    record = loaded(tmp_path, data)
    batch = only(record)
    assert (len(batch), batch.first_row) == (72, 5)
    assert np.array_equal(batch.velocity[:, 0], data["u_mps"][3:75])
    assert record.notes == (
        "trial.csv: cut rows 2 to 4 at the start, where north_m is missing",
        "trial.csv: cut rows 77 to 81 at the end, where heading_rad, u_mps are missing",
    )


def test_an_empty_optional_column_counts_as_not_measured(tmp_path: Path) -> None:
    data = motion()
    record = loaded(tmp_path, data | {name: 0 * data[name] + np.nan for name in ("depth_m", "wind_angle_rad")})
    assert only(record).depth_m is None
    assert only(record).wind is None
    assert record.notes == (
        "trial.csv: wind_angle_rad holds no numbers: not measured",
        "trial.csv: depth_m holds no numbers: not measured",
    )


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize("low", [-np.pi, 0.0])
def test_wrapped_headings_become_continuous(tmp_path: Path, unit: str, low: float) -> None:
    data = motion()
    heading = 3.0 + 0.2 * data["time_s"]
    wrapped = (heading - low) % (2 * np.pi) + low
    scale = 1.0 if unit == "rad" else 180 / np.pi
    names = ("time_s", "n1_rps", "u_mps", "v_mps")
    record = loaded(tmp_path, {name: data[name] for name in names} | {f"heading_{unit}": scale * wrapped})
    assert np.allclose(only(record).pose[:, 2], heading[1:-1])
    assert np.allclose(only(record).velocity[:, 2], 0.2)
    assert np.isnan(only(record).pose[:, :2]).all()
    times = int(np.sum(np.abs(np.diff(wrapped)) > 3))
    assert (
        record.notes[0] == f"trial.csv: heading_{unit} is wrapped {times} time{'s' * (times > 1)} and made continuous"
    )


def test_continuous_headings_of_many_turns_stay(tmp_path: Path) -> None:
    data = motion()
    heading = 5.0 + 0.5 * data["time_s"]
    data |= {"heading_rad": heading, "r_radps": 0 * heading + 0.5}
    record = loaded(
        tmp_path, {name: data[name] for name in ("time_s", "heading_rad", "u_mps", "v_mps", "r_radps", "n1_rps")}
    )
    assert np.array_equal(only(record).pose[:, 2], heading)


def test_gaps_and_batch_numbers_start_batches(tmp_path: Path) -> None:
    data = motion()
    data["time_s"] = data["time_s"] + np.where(np.arange(80) >= 30, 0.3, 0.0) + np.where(np.arange(80) >= 60, 7.0, 0.0)
    data["batch"] = np.where(np.arange(80) < 50, 1.0, 7.0)
    record = loaded(tmp_path, data)
    assert [(batch.name, batch.first_row, len(batch)) for batch in record.batches] == [
        ("trial.csv, batch 1", 2, 30),
        ("trial.csv, batch 2", 32, 20),
        ("trial.csv, batch 3", 52, 10),
        ("trial.csv, batch 4", 62, 20),
    ]
    assert record.notes == ("trial.csv: gaps in time_s of up to 7.5 s start a new batch in rows 32, 62",)
    assert np.array_equal(np.vstack([batch.velocity for batch in record.batches])[:, 0], data["u_mps"])


def test_a_gap_of_half_a_sample_more_is_no_gap_yet(tmp_path: Path) -> None:
    data = motion()
    data["time_s"] = data["time_s"] + 0.24 * (np.arange(80) >= 30) * SAMPLE_TIME_S
    assert len(loaded(tmp_path, data).batches) == 1


def test_single_samples_are_left_out(tmp_path: Path) -> None:
    data = motion()
    data["batch"] = np.select([np.arange(80) < 40, np.arange(80) == 40], [1.0, 2.0], 3.0)
    record = loaded(tmp_path, data)
    assert [len(batch) for batch in record.batches] == [40, 39]
    assert record.notes == ("trial.csv: left out row 42, batches of a single sample",)


def test_a_clock_may_start_again_where_the_batch_changes(tmp_path: Path) -> None:
    data = motion()
    again = data | {"time_s": data["time_s"] % 20.0, "batch": data["time_s"] // 20.0}
    assert [len(batch) for batch in loaded(tmp_path, again).batches] == [40, 40]


@pytest.mark.parametrize("origin", [0.0, -50.0, 1.7e9])
def test_times_count_from_anywhere(tmp_path: Path, origin: float) -> None:
    data = motion()
    record = loaded(tmp_path, data | {"time_s": data["time_s"] + origin})
    assert same(only(record), only(loaded(tmp_path, data)), tolerance=0)


def test_rounded_times_have_the_sample_time_of_their_mean(tmp_path: Path) -> None:
    data = motion()
    record = loaded(tmp_path, data | {"time_s": np.round(data["time_s"] / 4, 2)})  # 8 Hz written with two decimals
    assert only(record).sample_time_s == pytest.approx(0.125, rel=1e-3)
    path = tmp_path / "trial.csv"
    assert load_records(path, sample_time_s=0.125).batches[0].sample_time_s == 0.125


def test_inputs_come_in_the_order_of_the_vessel(tmp_path: Path) -> None:
    data = motion()
    path = write_trial(tmp_path / "trial.csv", data | {"tau_x": data["u_mps"]})
    record = load_records(path, vessel_inputs=("rudder1", "n1"))
    assert only(record).input_names == ("rudder1", "n1")
    assert np.array_equal(only(record).inputs, np.stack([data["rudder1_rad"], data["n1_rps"]], axis=-1))
    assert record.notes == ("trial.csv: ignored tau_x",)
    assert load_records(path, vessel_inputs=("tau_x",)).batches[0].input_names == ("tau_x",)
    assert load_records(path).batches[0].input_names == ("n1", "rudder1", "tau_x")
    assert load_records(path, vessel_inputs=()).batches[0].inputs.shape == (80, 0)


def test_files_with_the_same_name_are_distinguished(tmp_path: Path) -> None:
    paths = [tmp_path / folder / "trial.csv" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        write_trial(path, motion())
    assert [batch.name for batch in load_records(paths).batches] == [str(path) for path in paths]


def test_files_share_the_notes_that_are_the_same(tmp_path: Path) -> None:
    data = motion()
    paths = [write_trial(tmp_path / f"{name}.csv", data | {"leg": data["u_mps"]}) for name in "abc"]
    assert load_records(paths[:2]).notes == ("a.csv and 1 more file: ignored leg",)
    assert load_records(paths).notes == ("a.csv and 2 more files: ignored leg",)


@pytest.mark.parametrize("column", ["n1_rps", "rudder1_rad"])
def test_a_position_in_one_file_and_a_command_in_another_is_told(tmp_path: Path, column: str) -> None:
    data = motion()
    other = {(f"reached_{name}" if name == column else name): values for name, values in data.items()}
    paths = [write_trial(tmp_path / f"{name}.csv", own) for name, own in (("a", data), ("b", other), ("c", other))]
    (note,) = load_records(paths).notes
    assert note.startswith(
        f"{column} is a position that was reached in b.csv and 1 more file, and a command in a.csv: "
    )
    assert load_records(paths[1:]).notes == load_records(paths[:1]).notes == ()


def test_dead_sensors_and_idle_inputs_are_noted(tmp_path: Path) -> None:
    data = motion()
    record = loaded(tmp_path, data | {"wind_speed_mps": 0 * data["u_mps"] + 3, "n1_rps": 0 * data["u_mps"] + 5})
    assert record.notes == (
        "trial.csv: wind_speed_mps is 3 in all rows, a dead sensor?",
        "trial.csv: n1_rps is 5 in all rows, so how its effect depends on it cannot be estimated",
    )


@pytest.mark.parametrize("level", [0.0, 0.5])
@pytest.mark.parametrize(
    ("columns", "idle"),
    [
        (("n1_rps",), "n1_rps"),
        (("reached_n1_rps",), "reached_n1_rps"),  # what is reached is used in place of the command
        (("n1_rps", "reached_n1_rps"), "reached_n1_rps"),
        (("n1_rps", "moving reached_n1_rps"), ""),
        (("moving n1_rps", "reached_n1_rps"), "reached_n1_rps"),
        (("moving n1_rps", "planned_n1_rps", "planned_rudder1_rad"), ""),
    ],
)
def test_no_input_that_stands_still_is_called_a_dead_sensor(
    tmp_path: Path, level: float, columns: tuple[str, ...], idle: str
) -> None:
    data = motion()
    n1 = data.pop("n1_rps")
    for column in columns:
        data[column.removeprefix("moving ")] = n1 if column.startswith("moving ") else 0 * n1 + level
    lost = "how its effect depends on it" if level else "its effect"
    told = f"trial.csv: {idle} is {level:g} in all rows, so {lost} cannot be estimated"
    assert loaded(tmp_path, data).notes == ((told,) if idle else ())


@pytest.mark.parametrize(
    ("levels", "told"),
    [((5, 5), True), ((5, 6), False), ((5, None), False), ((None, 5), False), ((None, None), False)],
)
def test_an_input_is_idle_where_no_file_moves_it(
    tmp_path: Path, levels: tuple[float | None, float | None], told: bool
) -> None:
    data = motion()
    columns = [data if level is None else data | {"n1_rps": 0 * data["u_mps"] + level} for level in levels]
    paths = [write_trial(tmp_path / f"{name}.csv", own) for name, own in zip("ab", columns, strict=True)]
    idle = "a.csv and 1 more file: n1_rps is 5 in all rows, so how its effect depends on it cannot be estimated"
    assert load_records(paths).notes == (idle,) * told


def test_inputs_that_stand_at_one_value_are_told_in_one_note(tmp_path: Path) -> None:
    data = motion()
    idle = dict.fromkeys(("n2_rps", "n3_rps", "rudder1_rad"), 0 * data["u_mps"]) | {"n4_rps": 0 * data["u_mps"] + 2}
    assert loaded(tmp_path, data | idle).notes == (
        "trial.csv: rudder1_rad, n2_rps and n3_rps are 0 in all rows, so their effects cannot be estimated",
        "trial.csv: n4_rps is 2 in all rows, so how its effect depends on it cannot be estimated",
    )


def test_held_positions_are_noted(tmp_path: Path) -> None:
    data = motion()
    held = np.arange(80) // 5 * 5
    record = loaded(tmp_path, data | {name: data[name][held] for name in ("north_m", "east_m")})
    found = "trial.csv: the position repeats in 81% of the rows: differences of held values are inaccurate"
    assert found in record.notes


def test_an_odd_step_of_position_is_noted(tmp_path: Path) -> None:
    data = motion()
    data["north_m"][50:] += 12.0
    record = loaded(tmp_path, data)
    assert any(
        "the position changes by up to 12" in note and note.endswith("at once in row 52") for note in record.notes
    )


def test_two_winds_are_compared_and_the_cartesian_one_is_used(tmp_path: Path) -> None:
    data = motion()
    speed, angle = data["wind_speed_mps"], data["wind_angle_rad"]
    both = data | {"wind_u_mps": 1.01 * speed * np.cos(angle), "wind_v_mps": 1.01 * speed * np.sin(angle)}
    record = loaded(tmp_path, both)
    assert np.array_equal(only(record).wind[:, 0], both["wind_u_mps"])
    assert record.notes == ("trial.csv: the vane's wind agrees with wind_u_mps and wind_v_mps, which are used",)
    noisy = loaded(tmp_path, both | {"wind_angle_rad": angle + 2.0})
    assert "which are used" in noisy.notes[0]
    assert "differs by" in noisy.notes[0]


def test_what_is_not_asked_for_may_lack_and_is_nan(tmp_path: Path) -> None:
    data = motion()
    path = write_trial(tmp_path / "trial.csv", {name: data[name] for name in ("time_s", "u_mps", "n1_rps")})
    record = load_records(path, outputs=OUTPUTS[:1])
    assert np.array_equal(only(record).velocity[:, 0], data["u_mps"])
    assert np.isnan(only(record).velocity[:, 1:]).all()
    assert only(record).pose is None
    assert record.notes == ("trial.csv: v, r not measured",)
