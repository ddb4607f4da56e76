"""Formats of logs: one row of `READERS` each, asked in turn whether a file is theirs.

The library of a format is loaded when a file of it is met; a missing one is told with the extra that installs it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from expdesign.errors import FileError
from expdesign.importing.channels import Log, Reader, TooManyNumbers, check_size
from expdesign.importing.guess import cleaned
from expdesign.importing.readers.autopilots import is_ardupilot, is_ros, read_ardupilot, read_px4, read_ros
from expdesign.importing.readers.n2k import is_n2k, is_signalk, read_n2k, read_signalk
from expdesign.importing.readers.sheets import read_excel, read_matlab, read_matlab73, read_parquet
from expdesign.importing.readers.text import is_text, read_text
from expdesign.input_files import readable


def _begins(*magic: bytes) -> Callable[[Path, bytes], bool]:
    return lambda path, head: head.startswith(magic)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(64)


READERS = (
    Reader(
        name="PX4 ULog", meaning="positions, velocities, attitude, rates and outputs, by pyulog",
        fits=_begins(b"ULog\x01\x12\x35"), read=read_px4, extra="logs",
    ),
    Reader(
        name="ROS bag or MCAP", meaning="bags of ROS 1 and folders of ROS 2, by rosbags; axes of REP 103 are turned",
        fits=is_ros, read=read_ros, extra="logs",
    ),
    Reader(
        name="ArduPilot log", meaning=".bin and .log of the board, .tlog of the telemetry, by pymavlink",
        fits=is_ardupilot, read=read_ardupilot, extra="logs",
    ),
    Reader(
        name="Parquet", meaning="a table with a column of times, by pyarrow", fits=_begins(b"PAR1"), read=read_parquet,
        extra="logs",
    ),
    Reader(
        name="Excel", meaning="the first sheet of a .xlsx, read as the text that it shows, by openpyxl",
        fits=_begins(b"PK\x03\x04"), read=read_excel, extra="logs",
    ),
    Reader(
        name="MATLAB", meaning="vectors, matrices and structures of them, up to version 7, by scipy",
        fits=_begins(b"MATLAB 5.0"), read=read_matlab,
    ),
    Reader(
        name="MATLAB 7.3", meaning="the same of version 7.3, and other HDF5, by h5py",
        fits=_begins(b"MATLAB 7.3", b"\x89HDF"), read=read_matlab73, extra="logs",
    ),
    Reader(
        name="Signal K", meaning="deltas as JSON, one a line, also behind the time and provider of a server's log",
        fits=is_signalk, read=read_signalk, lines=True,
    ),
    Reader(
        name="NMEA 2000",
        meaning="as text, by nmea2000: plain and fast lines of canboat and Actisense, frames of Yacht Devices, "
        "candump -L; JSON of canboat's analyzer",
        fits=is_n2k, read=read_n2k, extra="logs", lines=True,
    ),
    Reader(
        name="text",
        meaning="tables with any separator, decimal sign, header and clock; NMEA 0183, also behind times of reception, "
        "in TAG blocks or in OpenCPN's records, by the fields of pynmeagps; AIVDO, by pyais; both in one file",
        fits=is_text, read=read_text, lines=True,
    ),
)  # fmt: skip
"""All formats; what no other one begins like may be text."""
NO_LOGS = {
    b"\xd0\xcf\x11\xe0": "a spreadsheet of the old format .xls, expected it saved as .xlsx or CSV",
    b"\x1f\x8b": "compressed by gzip, expected it unpacked",
    b"BZh": "compressed by bzip2, expected it unpacked",
    b"\xfd7zXZ": "compressed by xz, expected it unpacked",
    b"7z\xbc\xaf": "a 7z archive, expected the log itself, unpacked",
    b"Rar!": "a rar archive, expected the log itself, unpacked",
    b"\xd4\xc3\xb2\xa1": "a capture of a network (pcap), expected NMEA 2000 as text, as by candump -L",
    b"\n\r\r\n": "a capture of a network (pcapng), expected NMEA 2000 as text, as by candump -L",
    b"%PDF": "a PDF, expected the log itself",
    b"<?xml": "XML, expected a log with times, positions, speeds, headings and orders, as CSV or NMEA 0183",
}
"""How files begin that are no logs -> what they are, and what would be right."""

LONGEST_LINE = 1 << 24  # bytes


def read_log(path: Path, *, sample_time_s: float = 0.0, beside: int = 0) -> Log:
    """What a file, or the folder of a bag, holds.

    Args:
        sample_time_s: between rows of a table without a clock [s]; 0 where it is not known.
        beside: readings and times of other logs of the import, which are kept with these.

    Raises:
        FileError: missing, empty, of no known format, broken or too large, or the library that reads it is not
            installed.
    """
    with readable(path, "a log"):
        head = b"" if path.is_dir() else _head(path)
    if path.is_dir() and not is_ros(path, head):
        raise FileError(path, "", "is a folder without metadata.yaml, expected files, or the folder of a ROS 2 bag")
    if not head and not path.is_dir():
        raise FileError(path, "", "is empty, expected a log")
    if what := next((words for magic, words in NO_LOGS.items() if head.startswith(magic)), ""):
        raise FileError(path, "", f"is {what}")
    if not any(one.fits(path, head) for one in READERS if not one.lines):
        _check_lines(path)
    reader = next(one for one in READERS if one.fits(path, head))
    try:
        log = cleaned(reader.read(path, sample_time_s))
        check_size(beside + log.size)
        return log
    except ModuleNotFoundError as error:
        hint = f"needs {error.name}: pip install 'expdesign[{reader.extra or 'logs'}]'"
        raise FileError(path, "", f"is {reader.name}, which {hint}") from None
    except TooManyNumbers as most:
        logs = "of all logs of an import: import fewer at once" if beside else "at once: import it in parts"
        told = f"more than {most} readings and times, which is the most {logs}"
        raise FileError(path, "", f"{'makes' if beside else 'holds'} {told}") from None
    except FileError:
        raise
    except Exception as error:  # libraries raise anything on broken files
        what = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise FileError(path, "", f"begins like {reader.name} but cannot be read ({what})") from None


def _check_lines(path: Path) -> None:
    """Raise FileError where a line would not end, as it is read whole."""
    with path.open("rb") as file:
        while len(block := file.read(LONGEST_LINE)) == LONGEST_LINE:
            if b"\n" not in block and b"\r" not in block:
                size = f"{LONGEST_LINE / 2**20:g} MB"
                raise FileError(path, "", f"has a line of more than {size}, expected a log in lines")
