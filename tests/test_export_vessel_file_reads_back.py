"""A vessel written as a file and read again is the same vessel."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from vessel_files import KVLCC2, write_vessel

from expdesign.errors import InputError
from expdesign.export import vessel_toml
from expdesign.scenario import load_vessel
from expdesign.vessel import Vessel

FILES = sorted((Path(__file__).parents[1] / "scenarios" / "vessels").glob("*.toml"))


def same(a: Vessel, b: Vessel) -> bool:
    """Every field alike; numbers to the last bit."""
    models = all(
        np.array_equal(getattr(a.model, field.name), getattr(b.model, field.name))
        for field in fields(a.model)
        if field.name in ("parameters", "parameter_std")
    )
    names = ("terms", "form", "sample_time_s", "actuators")
    rest = all(getattr(a.model, name) == getattr(b.model, name) for name in names)
    return models and rest and replace(a, model=b.model) == b


def read_back(vessel: Vessel, folder: Path, **options: object) -> Vessel:
    path = folder / "again.toml"
    path.write_text(vessel_toml(vessel, **options), encoding="utf-8")
    return load_vessel(path)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_example_comes_back_the_same(path: Path, tmp_path: Path) -> None:
    vessel = load_vessel(path)
    assert same(vessel, read_back(vessel, tmp_path))


def test_a_custom_structure_comes_back_the_same(tmp_path: Path) -> None:
    vessel = load_vessel(write_vessel(tmp_path / "custom.toml", KVLCC2))
    assert same(vessel, read_back(vessel, tmp_path))
    assert "[[model.terms]]" in vessel_toml(vessel)


def test_numbers_and_names_of_any_kind_come_back(tmp_path: Path) -> None:
    vessel = load_vessel(write_vessel(tmp_path / "custom.toml", KVLCC2))
    scales = 10.0 ** np.linspace(-300, 11, len(vessel.model.names))
    values = np.random.default_rng(0).uniform(-1, 1, len(scales)) * scales
    model = replace(vessel.model, parameters=values, parameter_std=np.abs(values))
    odd = replace(vessel, name='Ship "Å" \\ No. 1 = # [x]', model=model)
    assert same(odd, read_back(odd, tmp_path, comments=("first", "second\nthird")))


def test_comments_go_first(tmp_path: Path) -> None:
    vessel = load_vessel(FILES[0])
    assert vessel_toml(vessel, comments=("one", "two\nthree")).startswith("# one\n# two\n# three\n[vessel]\n")


def test_a_sample_time_of_the_models_own_cannot_be_written() -> None:
    vessel = load_vessel(FILES[0])
    with pytest.raises(InputError, match="expected the same in a vessel file"):
        vessel_toml(replace(vessel, sample_time_s=0.3))
