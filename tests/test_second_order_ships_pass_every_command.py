"""Ships whose terms are of second order and read the actuators pass the commands that take data, azimuths in detail."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.dictionary import build_primitive
from expdesign.scenario import load_scenario, load_vessel
from expdesign.signals import Commands
from expdesign.simulation import Helm, positions, steady_ahead
from expdesign.workflows import new
from expdesign.workflows.commands.new import KINDS
from measured_trials import held, write_run

TRUE_SHARE = 0.06  # by which the true parameters differ from the file's, to both sides


def sailed(folder: Path, kind: str) -> tuple[str, ...]:
    """Names of the runs of a ship that differs a little from the vessel file, in a new folder of a kind."""
    case = load_scenario(new(folder, kind=kind).files[0])
    model = case.vessel.model
    signs = np.where(np.arange(len(model.parameters)) % 2, 1.0, -1.0)
    true = replace(case.vessel, model=model.with_parameters(model.parameters * (1.0 + TRUE_SHARE * signs)))
    np.savetxt(folder / "true.txt", true.model.parameters)
    for seed, spec in enumerate(case.dictionary):
        run = build_primitive(case.vessel, spec)
        write_run(
            folder / f"{spec.name}.csv", true, run.commands, velocity=tuple(run.entry_velocity.tolist()), seed=seed
        )
    return tuple(spec.name for spec in case.dictionary)


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the vessel file of azimuths, and runs."""
    folder = tmp_path_factory.mktemp("azimuths") / "trial"
    sailed(folder, "azimuth")
    return folder


def asked(folder: Path, command: str, *names: str, options: str = "") -> Path:
    """The folder of results of a command."""
    out = folder / command
    data = [str(folder / f"{name}.csv") for name in names]
    assert (
        main([command, *data, "--vessel", str(folder / "vessel.toml"), *options.split(), "--out", str(out), "--quiet"])
        == 0
    )
    return out


OTHERS = ("stop", "acceleration", "circle-helm-0.4", "circle-helm--0.4", "zigzag", "telegraph")


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_the_ship_of_each_kind_is_found_indexed_diagnosed_and_watched(kind: str, tmp_path: Path) -> None:
    """The parameters lie in their 95 % intervals, within three standard errors; of her own log she has no alarm."""
    folder = tmp_path / "trial"
    runs = sailed(folder, kind)
    found = load_vessel(asked(folder, "estimate", *runs, options="--method ls iv") / "vessel-estimated.toml").model
    apart = np.abs(found.parameters - np.loadtxt(folder / "true.txt")) / found.parameter_std
    assert np.mean(apart < 1.96) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / len(apart))
    assert any(asked(folder, "indices", *(name for name in runs if name.startswith("circle"))).glob("*.json"))
    assert any(asked(folder, "diagnose", *runs).glob("vessel-*.toml"))
    watch(folder)
    told = json.loads((folder / "monitor" / "monitor.json").read_text("utf-8"))
    assert told["alarms"] == []


def watch(folder: Path) -> None:
    """Watch the ship of the vessel file by her own log; hours at samples of 1 s, shorter at shorter samples."""
    vessel = load_vessel(folder / "vessel.toml")
    helm, speed_mps = Helm(vessel=vessel), steady_ahead(vessel).speed_mps
    for seed, (name, hours) in enumerate({"known": 1.5, "watched": 1.0}.items()):
        samples, rng = int(3600 * hours), np.random.default_rng(seed)
        engines, angle = (held(rng, samples) for _ in range(2))
        orders = helm.rows(0.6 + 0.15 * engines, 0.3 * angle)
        values, _ = positions(vessel.responses, orders, sample_time_s=vessel.sample_time_s, standing=None)
        commands = Commands(sample_time_s=vessel.sample_time_s, names=vessel.model.inputs, values=values)
        write_run(folder / f"{name}.csv", vessel, commands, velocity=(0.6 * speed_mps, 0.0, 0.0), seed=seed)
    asked(folder, "monitor", "watched", options=f"--reference {folder / 'known.csv'}")


@pytest.mark.thorough
def test_recorded_azimuths_that_are_wound_up_are_the_same(trial: Path) -> None:
    """An angle is taken modulo a turn."""
    found = []
    for turns in (0, 3):
        lines = (trial / "zigzag-20-20.csv").read_text("utf-8").splitlines()
        where = lines[0].split(",").index("a1_rad")
        rows = [line.split(",") for line in lines[1:]]
        for row in rows:
            row[where] = repr(float(row[where]) + 2 * np.pi * turns)
        (trial / f"wound-{turns}.csv").write_text(
            "\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n", "utf-8"
        )
        out = asked(trial, "estimate", f"wound-{turns}", *OTHERS, options="--method ls")
        found.append(load_vessel(out / "vessel-estimated.toml").model.parameters)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6)


def test_a_limit_of_turns_that_a_vessel_file_states_is_kept(trial: Path) -> None:
    """Without stops the azimuths of this zig-zag wind up two turns."""
    path, wound = trial / "stops.toml", []
    text = (trial / "vessel.toml").read_text("utf-8")
    (spec,) = [one for one in load_scenario(trial / "scenario.toml").dictionary if one.name == "zigzag"]
    for turns in (np.inf, 1.0):
        stop = 2 * np.pi * turns
        rate = "angle_rate_radps = 0.2\n"
        stops = f"{rate}angle_min_rad = {-stop}\nangle_max_rad = {stop}\n" if np.isfinite(stop) else rate
        path.write_text(text.replace(rate, stops), "utf-8")
        run = build_primitive(load_vessel(path), spec)
        wound.append(np.abs(run.commands.values[:, [1, 3]]).max() / (2 * np.pi))
    assert wound[0] > 1.5
    assert wound[1] <= 1.0 + 1e-12


def test_indices_take_them(trial: Path) -> None:
    assert any(asked(trial, "indices", "zigzag-20-20", "circle-helm-0.4").glob("*.json"))


@pytest.mark.thorough
def test_the_watch_takes_them_and_is_silent_on_the_ship_of_its_reference(trial: Path) -> None:
    vessel = load_vessel(trial / "vessel.toml")
    for seed, (name, hours) in enumerate({"known": 1.5, "watched": 1.0}.items()):
        samples, rng = int(3600 * hours), np.random.default_rng(seed)
        speed, one, two, tunnel = (held(rng, samples) for _ in range(4))
        orders = np.stack([2.5 + 0.5 * speed, 0.3 * one, 2.5 + 0.5 * speed, 0.3 * two, 3.0 * tunnel], axis=1)
        values, _ = positions(vessel.responses, orders, sample_time_s=1.0, standing=None)
        commands = Commands(sample_time_s=1.0, names=vessel.model.inputs, values=values)
        write_run(trial / f"{name}.csv", vessel, commands, velocity=(3.0, 0.0, 0.0), seed=seed)
    out = asked(trial, "monitor", "watched", options=f"--reference {trial / 'known.csv'}")
    told = json.loads((out / "monitor.json").read_text("utf-8"))
    assert told["alarms"] == []
