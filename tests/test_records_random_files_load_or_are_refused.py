"""Whatever a data file holds, it loads or is refused in one line."""

from itertools import zip_longest
from pathlib import Path

import numpy as np

from expdesign.errors import FileError
from expdesign.records import VELOCITY_METHODS, load_records
from expdesign.signals import Record
from record_files import motion, texts

ODD_TEXTS = ("", "nan", "inf", "1e308", "1e-320", "0", "abc", '"', "1,5", "\x00", "360", " ", "-1")
ODD_NAMES = ("time", "batch", "u", "v [kn]", "heading", "lat_deg", "wind_u_mps", "", "n1_rpm", "tau_x", "time_ms")


def randomly_spoiled(rng: np.random.Generator) -> str:
    """A trial with up to three random changes to names, cells and columns."""
    count = int(rng.choice([1, 2, 3, 5, 80]))
    columns = {name: values[:count] for name, values in texts(motion()).items()}
    for _ in range(rng.integers(1, 4)):
        name, odd = list(columns)[rng.integers(len(columns))], str(rng.choice(ODD_TEXTS))
        match rng.integers(4):
            case 0:
                columns[name][rng.integers(count)] = odd
            case 1:
                columns[name][rng.integers(count) :] = [odd]
            case 2:
                columns[str(rng.choice(ODD_NAMES))] = columns.pop(name)
            case _:
                columns[name] = [odd] * count
    return "\n".join([",".join(columns), *(",".join(row) for row in zip_longest(*columns.values(), fillvalue=""))])


def test_whatever_is_in_a_file_it_loads_or_gives_one_line(tmp_path: Path) -> None:
    rng, path = np.random.default_rng(0), tmp_path / "trial.csv"
    records: list[Record] = []
    messages: list[str] = []
    for _ in range(400):
        path.write_text(randomly_spoiled(rng), encoding="utf-8")
        try:
            records.append(load_records(path, velocity=str(rng.choice(VELOCITY_METHODS))))
        except FileError as error:
            messages.append(str(error))
    assert not any("\n" in message for message in messages)
    batches = [batch for record in records for batch in record.batches]
    assert all(np.isfinite(batch.velocity).all() and np.isfinite(batch.inputs).all() for batch in batches)
    assert min(len(records), len(messages)) > 20
