"""Trials of the diagnosis in which something is hidden: what, of which size, in whose data, and what was found.

Parts and columns are those of `diagnosis.py`, which counts them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
import hidden_effects as sea
from beyond_catalogue import CASES, SAYS
from diagnosis_case import Told, drawn_parameters, from_pose, hidden_records, vessel_of
from expdesign.diagnosis import CAUSES, diagnose
from expdesign.diagnosis.accuracy import WHOLE_S, pooled_fit
from expdesign.diagnosis.causes.candidate import Situation
from expdesign.diagnosis.data.windows import cut_windows
from expdesign.diagnosis.motion.simulation import initial_states, simulate_from_measured
from expdesign.diagnosis.select.forward_selection import fit_nuisance
from expdesign.diagnosis.select.score_tests import score_tests
from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.signals import Batch, Record
from expdesign.vessel import Vessel

LEAST_POINTS, GROWTH, MOST_GROWTHS = 5.0, 1.5, 6
LEVELS = (0.03, 0.1, 0.3, 1.0)  # sizes in the power part, in shares of the size that just costs the points asked
UNSEEN = {"gyro_scale": ("measured",), "gyro_bias": ("measured",), "sensor_delay": ("measured",)}
"""Faults of sensors that other ways of recording do without."""
AIR = ("W_abs_u_u", "W_abs_v_v", "W_uv")
PARTS = ("known", "uncertain", "clean", "pairs", "power", "varied", "beyond")
ALL = {"tug": 0b1111, "barge": 0b111, "coaster": 0b11}


@dataclass(frozen=True, kw_only=True)
class Hidden:
    """What is hidden: a cause and how; `scaled` are larger or smaller.

    Terms that the model is left `without` grow and shrink as a whole, other factors by what they differ from one.
    """

    cause: str
    effects: dict[str, float] = field(default_factory=dict)
    faults: dict[str, float] = field(default_factory=dict)
    factors: dict[str, float] = field(default_factory=dict)
    current: tuple[float, float] = (0.0, 0.0)
    wind: tuple[float, float] = (0.0, 0.0)
    shoaling: bool = False
    without: tuple[str, ...] = ()

    def told(self, relative_std: float) -> Told:
        """For the generator."""
        return Told(
            effects=self.effects, faults=self.faults, factors=self.factors, current=self.current, wind=self.wind,
            relative_std=relative_std,
        )  # fmt: skip

    def scaled(self, by: float) -> Hidden:
        """The same, larger."""
        fixed = ("acts_on", "dead_on", "roll_period_s", "roll_damping", "change_s")
        if "delay_s" in self.effects:
            by = _on_substeps(self.effects["delay_s"] * by) / self.effects["delay_s"]
        rest = {key: 0.0 if key in self.without else 1.0 for key in self.factors}
        return replace(
            self,
            effects={key: value * (1.0 if key in fixed else by) for key, value in self.effects.items()},
            faults={key: value * by for key, value in self.faults.items()},
            factors={key: rest[key] + (value - rest[key]) * by for key, value in self.factors.items()},
            current=(self.current[0] * by, self.current[1] * by),
        )

    def with_another(self, other: Hidden) -> Hidden:
        """Both at once."""
        return Hidden(
            cause=f"{self.cause}+{other.cause}", effects=self.effects | other.effects,
            faults=self.faults | other.faults, factors=self.factors | other.factors,
            current=tuple(np.add(self.current, other.current).tolist()),
            wind=tuple(np.add(self.wind, other.wind).tolist()), shoaling=self.shoaling or other.shoaling,
            without=(*self.without, *other.without),
        )  # fmt: skip

    def truths(self, ship: str, seed: int, relative_std: float) -> dict[str, float]:
        """What estimates of any cause ought to be, by their names in the results."""
        told, e, f = self.told(relative_std), self.effects, self.faults
        true = drawn_parameters(ship, told, np.random.default_rng(seed))
        kappa = "X_unn" if ship == "coaster" else "X_kappa"
        angled = {"tug": ("a", "a1", "a2"), "barge": ("tau_psi",), "coaster": ("rudder",)}[ship]
        groups = {"all", *sea.INPUTS[ship], *(name.rstrip("12") for name in sea.INPUTS[ship])}
        kinds = {name: e.get(name, 0.0) for name in sea.TERMS} | {kappa: e.get("kappa", 0.0)}
        return {
            **{name: true.get(name, 0.0) + more for name, more in (dict.fromkeys(true, 0.0) | kinds).items()},
            "toward_rad": float(np.arctan2(self.wind[1], self.wind[0])) % (2 * np.pi),
            "north_mps": self.current[0], "east_mps": self.current[1],
            **{f"{kind}_{group}_s": e.get(f"{kind}_s", 0.0) for kind in ("lag", "delay") for group in groups},
            **{f"deadband_{group}{'' if ship == 'barge' else '_rad'}": e.get("deadband", 0.0) for group in angled},
            **{f"angle_offset_{group}_rad": e.get("angle_offset", 0.0) for group in angled},
            "input_factor_rudder": 1 + e.get("rudder_scale", 0.0), "thrust_offset_m": e.get("asymmetry", 0.0),
            **{f"inertia_factor_{axis}": 1 + e.get(f"load_{axis}", 0.0) for axis in "uvr"},
            "damping_growth": e.get("shallow_damping", 0.0), "inertia_growth": e.get("shallow_inertia", 0.0),
            "roll_period_s": e.get("roll_period_s", 0.0), "roll_damping_ratio": e.get("roll_damping", 0.0),
            "Y_phi": e.get("roll_sway", 0.0),
            "N_phi": e.get("roll_yaw", 0.0), "time_s": e.get("change_s", 0.0),
            "gain_factor": 1 + e.get("change_gain", 0.0), "damping_factor": 1 + e.get("change_damping", 0.0),
            "heading_bias_rad": -f.get("heading_bias", 0.0), "velocity_angle_rad": -f.get("heading_bias", 0.0),
            "forward_m": f.get("lever_m", 0.0), "starboard_m": 0.0,
            **{f"{axis}_delay_s": f.get(f"late_{axis}", 0.0) for axis in "uvr"},
            "yaw_rate_bias_radps": f.get("gyro_bias", 0.0),
            "factor": 1 + (f["gyro"] if "gyro" in f else e.get("gain", 0.0)),
        }  # fmt: skip


def _on_substeps(delay_s: float) -> float:
    """The generator's actuators act from the next of its steps on."""
    return max(1, round(delay_s * sea.SUBSTEPS)) / sea.SUBSTEPS


def drawn_effect(cause: str, ship: str, rng: np.random.Generator, length_s: float) -> Hidden:
    """An effect of a cause, of a size drawn at random."""
    sign, size = float(rng.choice([-1, 1])), float(rng.uniform(0.5, 1.5))
    angle = float(rng.uniform(0, 2 * np.pi))
    way = np.array([np.cos(angle), np.sin(angle)])
    if cause == "current":
        vector = tuple((0.15 * size * way).tolist())
        return Hidden(cause=cause, current=vector)
    if cause == "wind":
        return Hidden(cause=cause, wind=tuple((7 * size * way).tolist()), without=AIR, factors=dict.fromkeys(AIR, 1.0))
    if cause == "parameters":
        names = {"tug": ("X_u", "Y_v", "N_r", "Y_abs_v_v"), "barge": ("X_u", "Y_v", "N_r", "Y_ur"),
                 "coaster": ("X_u", "Y_v", "N_r", "Y_rud")}[ship]  # fmt: skip
        return Hidden(cause=cause, factors={str(rng.choice(names)): 1 + 0.3 * sign * size})
    if cause == "missing_term":
        name = str(rng.choice({"tug": ["N_uv"], "barge": ["X_abs_u_u", "Y_abs_v_v", "Y_abs_v_r"],
                               "coaster": ["Y_abs_v_v", "Y_abs_v_r", "N_abs_v_r"]}[ship]))  # fmt: skip
        value = {"X": -0.02, "Y": -0.06, "N": -0.03}[name[0]] * size
        if name in sea.SHIPS[ship]:  # the ship has it, the model is left without
            return Hidden(cause=f"missing_term:{name}", without=(name,), factors={name: 1 + size})
        return Hidden(cause=f"missing_term:{name}", effects={name: value})
    if cause in ("actuator_lag", "actuator_delay"):
        kind = cause.split("_")[1]
        late = _on_substeps(4 * size) if kind == "delay" else 4 * size
        return Hidden(cause=cause, effects={f"{kind}_s": late, "acts_on": ALL[ship]})
    if cause == "actuator_deadband":
        which, width = {"tug": (0b1010, 0.2), "barge": (0b100, 12.0), "coaster": (0b10, 0.15)}[ship]
        return Hidden(cause=cause, effects={"deadband": width * size, "dead_on": which})
    if cause == "thruster_asymmetry":
        if ship == "barge":
            return Hidden(cause=cause, effects={"asymmetry": 0.6 * sign * size})
        return Hidden(cause=cause, effects={"angle_offset": 0.06 * sign * size})
    if cause == "load_change":
        axis = str(rng.choice(list("uvr")))
        return Hidden(cause=cause, effects={f"load_{axis}": 0.3 * size})
    if cause == "sensor_delay":
        axis = str(rng.choice(list("vr")))
        return Hidden(cause=cause, faults={f"late_{axis}": 2 * size})
    if cause == "change_point":
        what = str(rng.choice(["change_gain", "change_damping"]))
        return Hidden(cause=cause, effects={"change_s": length_s * rng.uniform(0.25, 0.75), what: 0.25 * sign * size})
    if cause == "roll_coupling":
        return Hidden(cause=cause, effects={"roll_period_s": rng.uniform(6, 20), "roll_damping": 0.08,
                                            "roll_sway": 0.4 * size, "roll_yaw": 0.01 * size})  # fmt: skip
    if cause == "shallow_water":
        return Hidden(cause=cause, shoaling=True,
                      effects={"shallow_damping": 0.8 * size, "shallow_inertia": 0.3 * size})  # fmt: skip
    loss = 0.0003 if ship == "coaster" else 0.002
    return {
        "actuator_scale": Hidden(cause=cause, effects={"rudder_scale": 0.12 * sign * size}),
        "thrust_gain": Hidden(cause=cause, effects={"gain": 0.12 * sign * size}),
        "thrust_advance_loss": Hidden(cause=cause, effects={"kappa": -loss * size}),
        "heading_bias": Hidden(cause=cause, faults={"heading_bias": 0.04 * sign * size}),
        "lever_arm": Hidden(cause=cause, faults={"lever_m": 3 * sign * size}),
        "gyro_scale": Hidden(cause=cause, faults={"gyro": 0.08 * sign * size}),
        "gyro_bias": Hidden(cause=cause, faults={"gyro_bias": 0.003 * sign * size}),
    }[cause]


NAMES = tuple(cause.name for cause in CAUSES if cause.name not in ("actuator_slew", "late_orders", "log_scale"))
"""Causes hidden: all but a rate, which no file here states, late orders, and the scale of a log, told by positions."""


def drawn_ship(cause: str, rng: np.random.Generator, only: str | None) -> str:
    """A ship that can have the effect, the one asked for if it can; the tug's simulations cost most."""
    if cause == "wind":
        return "tug"
    if cause == "actuator_scale":
        return "coaster"
    return only or str(rng.choice(("barge", "barge", "coaster", "tug")))


@dataclass(frozen=True, kw_only=True)
class Case:
    """A trial to sail: everything but what is hidden."""

    ship: str
    seed: int
    manoeuvre: str
    batches: int
    samples: int
    step_s: float = 1.0
    recorded: str = "measured"
    wind: bool = True

    def records(self, hidden: Sequence[Hidden], *stds: float) -> list[list[Record]]:
        """Data of trials that differ in what is hidden, all shoaling or none, for every std of the parameters."""
        told = [one.told(std) for std in stds for one in hidden]
        records = hidden_records(
            self.ship, told, seed=self.seed, shoaling=hidden[0].shoaling, batches=self.batches, samples=self.samples,
            manoeuvre=self.manoeuvre, step_s=self.step_s,
        )  # fmt: skip
        records = [Record(batches=tuple(self._told(batch) for batch in record.batches)) for record in records]
        return [records[low : low + len(hidden)] for low in range(0, len(records), len(hidden))]

    def _told(self, batch: Batch) -> Batch:
        """What of a batch is recorded."""
        if self.recorded == "measured":
            return batch if self.wind else replace(batch, wind=None)
        return from_pose(batch, smoothed=self.recorded == "smoothed", wind=self.wind)

    def vessel(self, hidden: Hidden, relative_std: float = 0.0) -> Vessel:
        """The model in use."""
        return vessel_of(self.ship, relative_std=relative_std, without=hidden.without, sample_time_s=self.step_s)

    def truths(self, hidden: Hidden, std: float) -> dict[str, float]:
        """What estimates ought to be.

        Drag in a wind that nobody measured is for a speed that is taken; runs that lose samples at their ends, laid end
        to end, have another time of change.
        """
        unknown = () if self.wind else AIR
        unknown += ("time_s",) if self.recorded == "derived" else ()
        true = hidden.truths(self.ship, self.seed, std)
        return {name: value for name, value in true.items() if name not in unknown}

    def varied(self, cause: str, rng: np.random.Generator) -> Case:
        """The same trial, recorded otherwise."""
        total_s, batches = self.batches * self.samples * self.step_s, int(rng.choice([1, 3, self.batches]))
        step_s = float(rng.choice([1.0, 0.5] if batches == 1 else [1.0, 0.5, 0.2, 0.1]))
        recorded = str(rng.choice(UNSEEN.get(cause, ("measured", "derived", "smoothed"))))
        return replace(
            self, batches=batches, samples=int(total_s / batches / step_s), step_s=step_s, recorded=recorded,
            wind=bool(rng.integers(2)),
        )  # fmt: skip


def drawn_case(ship: str, seed: int, rng: np.random.Generator) -> Case:
    """Manoeuvres and their lengths: 20 to 30 minutes in 8 to 12 runs."""
    batches = int(rng.integers(8, 13))
    return Case(
        ship=ship, seed=seed, manoeuvre=str(rng.choice(list(sea.MANOEUVRES))), batches=batches,
        samples=int(rng.uniform(1200, 1800) / batches),
    )  # fmt: skip


def mean_fits(vessel: Vessel, records: Sequence[Record]) -> list[float]:
    """Of a model on each of the records, over u, v, r [%]; simulated as one record of many runs."""
    joined = Record(batches=tuple(batch for record in records for batch in record.batches))
    ship = extended_model(vessel, joined)
    windows = cut_windows(ship.model, joined, longest_s=WHOLE_S)
    motion = simulate_from_measured(ship, windows)
    parts = zip(*(np.split(item[..., :3], len(records)) for item in (motion.error, windows.measured)), strict=True)
    return [float(np.clip(pooled_fit(error, measured), -100, 100).mean()) for error, measured in parts]


def large_enough(case: Case, hidden: Hidden, std: float = 0.0, *, just: bool = False) -> tuple[Hidden, float, Record]:
    """The effect, enlarged until it costs what is asked, what it costs with known parameters, and data with it.

    Small ones may stay smaller, and then say so. With `just`, large ones are made smaller down to what is asked.
    """
    powers = range(-MOST_GROWTHS if just else 0, MOST_GROWTHS + 1)
    sizes = [hidden.scaled(GROWTH**power) for power in powers]
    none = Hidden(cause="none", shoaling=hidden.shoaling)
    (calm, *records), (_, *chosen_from) = case.records([none, *sizes], 0.0, std)
    (clean,) = mean_fits(case.vessel(none), [calm])
    lost = [clean - fit for fit in mean_fits(case.vessel(hidden), records)]
    chosen = next((index for index, points in enumerate(lost) if points >= LEAST_POINTS), len(sizes) - 1)
    return sizes[chosen], lost[chosen], chosen_from[chosen]


def oracle(vessel: Vessel, record: Record, cause_name: str) -> float:
    """Smallest p of the true cause's candidates, times their number, beside the nuisance alone."""
    ship = extended_model(vessel, record)
    windows = cut_windows(ship.model, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    situation = Situation(ship=ship, windows=windows)
    mine = [item for cause in CAUSES for item in cause.candidates(situation) if item.cause == cause_name]
    found = score_tests(base, mine, np.random.default_rng(0))
    return min((item.adjusted for item in found), default=1.0) if mine else float("nan")


def another(case: Case, hidden: Hidden, rng: np.random.Generator) -> Hidden:
    """A second effect that costs as much by itself."""
    names = [n for n in NAMES if n not in (hidden.cause.split(":")[0], "wind", "change_point")]
    other = drawn_effect(str(rng.choice(names)), case.ship, rng, case.batches * float(case.samples))
    return large_enough(case, other)[0]


def tried_beyond(number: int, seed: int) -> dict[str, object]:
    """One trial with an effect that no cause of the catalogue is."""
    name = list(CASES)[number % len(CASES)]
    found = diagnose(*CASES[name](seed + number // len(CASES)), seed=number)
    return {
        "part": "beyond", "number": number, "seed": seed, "cause": name, "fit": found.before.fit.tolist(),
        "findings": [{"cause": item.cause, "gain": item.gain} for item in found.findings], "verdict": found.verdict,
        "right": any(words in found.verdict for words in SAYS[name]),
    }  # fmt: skip


def tried(part: str, number: int, seed: int, only: str | None = None) -> dict[str, object]:
    """One trial."""
    if part == "beyond":
        return tried_beyond(number, seed)
    whole = np.random.SeedSequence([seed, PARTS.index(part), number])
    rng = np.random.default_rng(whole)
    name = NAMES[number % len(NAMES)]
    ship = drawn_ship(name, rng, only)
    case = drawn_case(ship, int(whole.generate_state(1)[0]), rng)
    uncertain = part == "uncertain" or (part == "clean" and number % 2 == 1)
    std = 0.1 if uncertain else 0.0
    hidden, lost, record, scale = Hidden(cause="none"), 0.0, None, 1.0
    if part != "clean":
        effect = drawn_effect(name, ship, rng, case.batches * float(case.samples))
        hidden, lost, record = large_enough(case, effect, std, just=part == "power")
    if part == "pairs":
        hidden, record = hidden.with_another(another(case, hidden, rng)), None
    if part == "power":
        scale = LEVELS[number // len(NAMES) % len(LEVELS)]
        hidden, record = hidden.scaled(scale), None
    if part == "varied":
        case, record = case.varied(name, rng), None
    if record is None:
        ((record,),) = case.records([hidden], std)
    row: dict[str, object] = {
        "part": part, "number": number, "seed": seed, "scale": scale, "cause": hidden.cause, "ship": ship, "std": std,
        "lost": lost, "manoeuvre": case.manoeuvre, "truth": case.truths(hidden, std),
        "effects": hidden.effects | hidden.faults | hidden.factors,
        "recorded": [case.recorded, case.wind, case.batches, case.step_s],
    }  # fmt: skip
    try:
        found = diagnose(case.vessel(hidden, std), record, seed=number)
    except Exception as error:  # a crash is a result of the campaign, not its end
        return row | {"crash": f"{type(error).__name__}: {error}", "findings": [], "oracle": float("nan")}
    row["findings"] = [
        {
            "cause": item.cause, "gain": item.gain, "low": item.gain_interval[0],
            "same": item.not_distinguishable_from, "estimates": [(e.name, e.value, e.std) for e in item.estimates],
        }
        for item in found.findings
    ]  # fmt: skip
    row["oracle"] = (
        float("nan") if part in ("clean", "pairs") else oracle(case.vessel(hidden, std), record, hidden.cause)
    )
    return row
