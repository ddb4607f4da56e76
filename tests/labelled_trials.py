"""Simulated trials with labels: a folder of CSV files, `LABEL_NUMBER.csv`, one run of a primitive each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from expdesign.dictionary import Primitive
from expdesign.export.files.text import record_csv
from expdesign.rehearsal.validation import heading_rad
from expdesign.signals import Batch
from expdesign.simulation import CALM, Environment, simulate_ensemble
from expdesign.vessel import Vessel

Weather = Callable[[str, int], Environment]
"""Label and number of a run -> what she sails in."""


def calm(label: str, number: int) -> Environment:
    """No wind, no current."""
    return CALM


def label_of(primitive: Primitive) -> str:
    """tau12 of tau12-surge-acceleration."""
    return primitive.name.partition("-")[0]


def sailed(
    ship: Vessel,
    primitives: Sequence[Primitive],
    *,
    count: int,
    seed: int = 0,
    weather: Weather = calm,
    integrator: str = "rk4",
) -> dict[str, Batch]:
    """`count` measured runs of every primitive by file name, each on a heading and with noise of its own."""
    found: dict[str, Batch] = {}
    for place, primitive in enumerate(primitives):
        for number in range(count):
            label = label_of(primitive)
            runs = simulate_ensemble(
                ship,
                primitive.commands.values,
                runs=1,
                environment=weather(label, number),
                rng=np.random.default_rng([seed, place, number]),
                pose=(0.0, 0.0, heading_rad(len(found))),
                velocity=primitive.entry_velocity,
                standing=primitive.entry_inputs,
                integrator=integrator,
                substeps=1 if integrator == "euler" else 4,
            )
            found[f"{label}_{number + 1}.csv"] = runs.batch(0)
    return found


def write_labelled(folder: Path, batches: dict[str, Batch], *, wind: bool = False) -> Path:
    """A file for every run; without wind unless it is wished."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, batch in batches.items():
        (folder / name).write_text(record_csv([batch if wind else replace(batch, wind=None)]), encoding="utf-8")
    return folder
