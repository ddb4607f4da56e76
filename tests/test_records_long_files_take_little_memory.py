"""Long files are read in blocks: memory for the numbers, not for their texts, and the same errors in any block."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import FileError
from expdesign.records.file import cells, read_table
from expdesign.records.file.cells import BLOCK_ROWS, READ_BYTES

HEADER = "time_s,u_mps,v_mps,r_radps,n1_rps,a1_rad"


def rows(count: int) -> list[str]:
    return [f"{k / 2:.2f},1.2345678,-0.0123456,0.0012345,2.5000000,0.{k % 1000:07d}" for k in range(count)]


def written(path: Path, lines: list[str], *, end: str = "\n") -> Path:
    path.write_text("\n".join([HEADER, *lines]) + end, encoding="utf-8")
    return path


def test_memory_is_a_few_times_that_of_the_numbers(tmp_path: Path) -> None:
    path = written(tmp_path / "long.csv", rows(60_000))
    tracemalloc.start()
    table = read_table(path, inputs=None)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    numbers = sum(values.nbytes for values in table.columns.values())
    block = BLOCK_ROWS * 6 * 100  # a text of few letters takes less than 100 bytes
    assert peak < 3 * numbers + 2 * block + 2 * READ_BYTES


@pytest.mark.parametrize("block_rows", [1, 2, 7, 100])
def test_the_size_of_blocks_changes_no_number(block_rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "some.csv", rows(50), end="\n\n\n")
    whole = read_table(path, inputs=None)
    monkeypatch.setattr(cells, "BLOCK_ROWS", block_rows)
    monkeypatch.setattr(cells, "READ_BYTES", block_rows)
    parts = read_table(path, inputs=None)
    assert all(np.array_equal(parts.columns[name], whole.columns[name]) for name in whole.columns)


BROKEN = {
    "wide": ({30: "1,2", 41: "3"}, "row 30: has 2 cells, expected 6 cells as in the header; 1 more rows differ too"),
    "empty inside": ({20: "", 21: ""}, "row 20: is empty, expected 6 cells as in the header; 1 more rows differ too"),
    "text": ({33: "16,1,0,x,2,0", 12: "5.5,1,0,0,2,y"}, "r_radps: is 'x' in row 33, expected a number"),
    "underscore": ({33: "16,1,0,0,2_0,0"}, "n1_rps: is '2_0' in row 33, expected a number"),
    "huge": ({8: "3.5,1,0,inf,2,0", 40: "19.5,1,0,inf,2,0"}, "r_radps: is infinite in rows 8, 40, expected finite"),
    "missing": ({25: "12,1,0,n/a,2,0"}, "r_radps: is 'n/a' in row 25, expected a number in every row"),
    "quoted": ({25: '12,1,0,"0"x,2,0'}, "row 25: is not readable CSV"),
}


@pytest.mark.parametrize("block_rows", [1, 3, 10, 1000])
@pytest.mark.parametrize("kind", BROKEN)
def test_errors_are_the_same_wherever_blocks_end(
    kind: str, block_rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changed, message = BROKEN[kind]
    lines = rows(50)
    for row, line in changed.items():
        lines[row - 2] = line
    monkeypatch.setattr(cells, "BLOCK_ROWS", block_rows)
    with pytest.raises(FileError) as caught:
        read_table(written(tmp_path / "broken.csv", lines), inputs=None)
    assert message in str(caught.value)


@pytest.mark.parametrize("read_bytes", [1, 2, 3, 64, 1 << 20])
@pytest.mark.parametrize(("byte", "place"), [(b"\xff", 40), (b"\xc3(", 100), (b"\xe2\x82", 200)])
def test_the_first_byte_that_is_no_text_is_found_wherever_it_is_read(
    read_bytes: int, byte: bytes, place: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = written(tmp_path / "bytes.csv", rows(10)).read_bytes()
    (tmp_path / "bytes.csv").write_bytes("\N{EURO SIGN}".encode() + content[:place] + byte + content[place:])
    monkeypatch.setattr(cells, "READ_BYTES", read_bytes)
    with pytest.raises(FileError, match=rf"is not UTF-8 text \(byte 0x{byte[0]:02x} at offset {place + 3}\)"):
        read_table(tmp_path / "bytes.csv", inputs=None)
