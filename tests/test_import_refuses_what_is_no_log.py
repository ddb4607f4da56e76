"""What is no log ends in one line; what is odd in one is read as it should be, and told."""

from __future__ import annotations

import gzip
import importlib.util
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.errors import FileError
from expdesign.importing import Channel, Log, guess, read_log
from expdesign.importing.mapping import FACTORS, SHARES, dimension, unit_word

pytestmark = pytest.mark.usefixtures("undrawn")

HEAD = "time,lat,lon,sog,cog,hdg,rpm,rudder"
ROWS = [f"{k},54.{k:05d},18.5,5.0,{k},{k},3.0,{k // 20 % 2 * 10}" for k in range(60)]
TABLE = "\n".join([HEAD, *ROWS, ""])


def packed(**files: str) -> bytes:
    """A zip archive of these."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name.replace("__", "/"), text)
    return memory.getvalue()


NO_LOGS = {
    "a million columns": ((",".join(["1"] * 10**6) + "\n").encode() * 2, "has 1000000 columns, expected at most 2000"),
    "wide, with a header": (",".join(f"c{k}" for k in range(2002)).encode() + b"\n1,2\n", "has 2002 columns"),
    "null bytes": (TABLE.replace("54.", "54\0.").encode(), "is not text"),
    "text that ends in null bytes": (TABLE.encode() + bytes(4000), "is not text"),
    "one column": (b"speed\n1\n2\n3\n", "holds no rows of numbers"),
    "one long line": (b"x" * 10**6, "holds no rows of numbers"),
    "JSON": (b'{"a":[1,2,3]}' * 50, "holds no rows of numbers"),
    "GPX": (b'<?xml version="1.0"?><gpx></gpx>', "is XML, expected a log with times"),
    "gzip": (gzip.compress(TABLE.encode()), "is compressed by gzip, expected it unpacked"),
    "PDF": (b"%PDF-1.4\n" + bytes(range(256)), "is a PDF"),
    "zip": (packed(notes="hi"), "is a zip archive with notes, expected the log itself"),
    "Signal K without times": (
        b'{"updates":[{"values":[{"path":"navigation.headingTrue","value":1.0}]}]}\n' * 9, "is Signal K without"
    ),
    "NMEA 2000 without times": (b"<0x18eeff01> [8] 05 a0 be 1c 00 a0 a0 c0\n" * 9, "is NMEA 2000 without times"),
    "NMEA 2000 of other things": (b"(1502979132.1) can0 18EEFF01#05A0BE1C00A0A0C0\n" * 9, "without rudder, heading"),
}  # fmt: skip


@pytest.mark.parametrize("case", NO_LOGS)
def test_what_is_no_log_is_refused_in_one_line_and_leaves_nothing(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content, told = NO_LOGS[case]
    path = tmp_path / "a.log"
    path.write_bytes(content)
    if case.startswith("NMEA 2000 of") and importlib.util.find_spec("nmea2000") is None:
        pytest.skip("needs nmea2000")
    assert main(["import", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert path.name in line
    assert told in line
    assert not (tmp_path / "out").exists()


def test_a_spreadsheet_that_unpacks_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("openpyxl")
    path = tmp_path / "a.xlsx"
    path.write_bytes(packed(**{"xl__workbook.xml": "", "xl__worksheets__sheet1.xml": " " * 10**6}))
    monkeypatch.setattr("expdesign.importing.readers.sheets.MOST_UNPACKED", 10**5)
    with pytest.raises(FileError, match="unpacks to"):
        read_log(path)


def test_sheets_beside_the_first_and_a_full_sheet_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in [HEAD.split(","), *([float(cell) for cell in row.split(",")] for row in ROWS)]:
        book.active.append(row)
    book.create_sheet("second half").append([1.0, 2.0])
    book.save(tmp_path / "a.xlsx")
    log = read_log(tmp_path / "a.xlsx")
    assert log.unused == ("sheet second half",)
    assert not any("are filled" in note for note in log.notes)
    monkeypatch.setattr("expdesign.importing.readers.sheets.MOST_ROWS", 61)
    assert any(note.startswith("all 61 rows of the sheet are filled") for note in read_log(tmp_path / "a.xlsx").notes)
    monkeypatch.setattr("expdesign.importing.readers.sheets.MOST_ROWS", 60)
    with pytest.raises(FileError, match="more than 60 rows"):
        read_log(tmp_path / "a.xlsx")


def test_columns_of_one_name_are_kept_apart_and_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(TABLE.replace("hdg,rpm", "hdg,hdg").replace(",3.0,", ",90.0,"))
    names = [channel.name for channel in read_log(tmp_path / "a.csv").channels]
    assert names == ["lat", "lon", "sog", "cog", "hdg", "hdg (2)", "rudder"]
    channel = next(channel for channel in read_log(tmp_path / "a.csv").channels if channel.name == "hdg")
    assert np.array_equal(channel.values, np.arange(60))


def test_readings_that_nothing_can_be_are_left_out_and_told(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(TABLE.replace("7,54.00007,18.5,5.0", "7,54.00007,18.5,1e300"))
    log = read_log(tmp_path / "a.csv")
    assert {len(channel) for channel in log.channels} == {59, 60}
    assert any(note.startswith("sog: readings beyond 1e+20") for note in log.notes)


@pytest.mark.parametrize(
    "text", [TABLE, "\n".join([HEAD, *ROWS[::-1], ""]), "\n".join([HEAD, *ROWS[:30][::-1], *ROWS[30:], ""])]
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1252"])
def test_order_of_rows_and_encoding_make_no_difference(text: str, encoding: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    (sog,) = (channel for channel in read_log(tmp_path / "a.csv").channels if channel.name == "hdg")
    assert np.array_equal(sog.values, np.arange(60)) or np.array_equal(np.sort(sog.values), np.arange(60))
    assert (np.diff(sog.time_s) > 0).all()


@pytest.mark.parametrize("unit", ["kn", "m/s", "deg", "m", "rpm", "deg/min", "%"])
def test_a_stated_unit_keeps_a_channel_from_columns_of_another_kind(unit: str) -> None:
    names = ("Spd n", "rudder", "heading", "depth", "ROT", "rpm", "azimuth angle", "lat", "sog")
    logs = [Log(source="a", clock="", channels=tuple(
        Channel(name=name, source="a", unit=unit, time_s=np.arange(50.0), values=np.sin(np.arange(50.0)))
        for name in names
    ))]  # fmt: skip
    for use in guess(logs).uses:
        if use.column and unit not in SHARES:
            assert unit_word(unit) in FACTORS[dimension(use.column)], use


@pytest.mark.parametrize("rows", [1, 2, 9, 10, 11, 14, 25])
def test_the_first_rows_of_a_log_are_read_or_refused(tmp_path: Path, rows: int) -> None:
    """Ten rows are the fewest of a run; they are shorter than what is looked at before and after an order."""
    log = [f"{k},54.{2 * k:05d},18.5,5.0,0,0,3.0,{k % 3 * 10}" for k in range(rows)]
    (tmp_path / "short.csv").write_text("\n".join([HEAD, *log, ""]), "utf-8")
    status = main(["import", str(tmp_path / "short.csv"), "--length-m", "110", "--out", str(tmp_path / "runs"), "-q"])
    assert status == (2 if rows == 1 else 3 if rows < 10 else 0)
