"""What a command may be asked: an option or argument, and those that several commands share."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self, dataclass_transform, get_args, get_origin, get_type_hints

from expdesign.errors import InputError


@dataclass(frozen=True)
class Option:
    """An option of a command, beside the type and the default of its field."""

    flag: str = ""  # as it is typed; by default the name of the field
    short: str = ""  # one letter, as in -o
    metavar: str | None = None
    help: str = ""
    min: float | None = None
    max: float | None = None
    over: float | None = None  # it must be larger, and finite
    parser: Callable[[str], Any] | None = None  # of what is typed
    stated: bool = False  # whether the command that repeats a call states a usual value, too

    @property
    def range(self) -> str:
        """The values that are allowed, in words; none where all are."""
        limits = ((self.over, "more than {:g}"), (self.min, "at least {:g}"), (self.max, "at most {:g}"))
        return " and ".join(words.format(limit) for limit, words in limits if limit is not None)

    def allows(self, value: float) -> bool:
        """Whether a value is in this range."""
        over = self.over is None or self.over < value < math.inf
        return over and (self.min is None or value >= self.min) and (self.max is None or value <= self.max)


@dataclass(frozen=True)
class Argument:
    """What is typed without a name."""

    metavar: str
    help: str


@dataclass(frozen=True, kw_only=True)
class Asked:
    """One option or argument of a command."""

    name: str  # of the field
    kind: Any  # its type
    typed: Option | Argument  # how it is given
    default: Any  # MISSING where it must be given

    @property
    def flag(self) -> str:
        """As it is typed; empty for an argument."""
        return "" if isinstance(self.typed, Argument) else self.typed.flag or f"--{self.name.replace('_', '-')}"

    @property
    def choices(self) -> tuple[str, ...]:
        """Words of which it is one; none where it is something else."""
        return next((get_args(kind) for kind in (self.kind, *get_args(self.kind)) if get_origin(kind) is Literal), ())

    def check(self, value: Any) -> None:
        """Check a value, also where no command line has.

        Raises:
            InputError: it is out of its range, none of its choices, or nothing is given.
        """
        if value == () and self.default is MISSING:
            raise InputError(f"no {self.typed.metavar or self.flag} is given, expected one or more")
        if isinstance(self.typed, Argument) or value is None:
            return
        if self.choices and value not in self.choices:
            raise InputError(f"{self.flag} is {value}, expected one of {', '.join(self.choices)}")
        if self.typed.range and not self.typed.allows(value):
            raise InputError(f"{self.flag} is {value:g}, expected {self.typed.range}")


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Request:
    """What a command is asked: annotations are its options, class attributes their defaults, the docstring its help.

    It is a frozen dataclass to the type checker. At run time it is less, as every command loads all of them.
    """

    def __init__(self, **values: object) -> None:
        """Take values by name; where several may be given, a list, a single one or None becomes a tuple.

        Raises:
            TypeError: a name is unknown or missing.
            InputError: a value is not allowed.
        """
        asked = {one.name: one for one in self.asked()}
        unknown = sorted({*values} - {*asked})
        missing = [name for name, one in asked.items() if values.get(name, one.default) is MISSING]
        if wrong := [("knows no", unknown)] * bool(unknown) + [("needs", missing)] * bool(missing):
            words = " and ".join(f"{what} {', '.join(names)}" for what, names in wrong)
            raise TypeError(f"{type(self).__name__} {words}")
        for name, value in values.items():
            vars(self)[name] = _several(value) if get_origin(asked[name].kind) is tuple else value
        for name, one in asked.items():
            one.check(getattr(self, name))

    @classmethod
    @cache
    def asked(cls) -> tuple[Asked, ...]:
        """Options and arguments, in their order."""
        hints = get_type_hints(cls, include_extras=True)
        return tuple(
            Asked(name=name, kind=kind, typed=typed, default=getattr(cls, name, MISSING))
            for name, (kind, typed) in ((name, get_args(hint)) for name, hint in hints.items())
        )

    def but(self, **changes: object) -> Self:
        """The request with some values changed."""
        return type(self)(**{**vars(self), **changes})


def _several(value: Any) -> tuple[Any, ...]:
    return (value,) if isinstance(value, (str, Path)) else tuple(value or ())


def parse_seed(text: str) -> int:
    """The seed of all random numbers.

    Raises:
        InputError: not a whole number of 0 or more.
    """
    return _count("--seed", text)


def parse_jobs(text: str) -> int:
    """The number of processes, 0 for one per core.

    Raises:
        InputError: not a whole number of 0 or more.
    """
    return _count("--jobs", text)


def _count(option: str, text: str) -> int:
    if not str(text).isdecimal():
        raise InputError(f"{option} is {text}, expected a whole number of 0 or more")
    return int(text)


def out_option(default: str) -> object:
    """`--out`; `default` says where results go without it."""
    return Option("--out", "-o", metavar="FOLDER", help=f"Folder for the results. Default: {default}.")


Out = Annotated[Path | None, out_option("runs/<name of the scenario>")]
OutBesidePlan = Annotated[Path | None, out_option("the folder of the plan")]
OutByData = Annotated[Path | None, out_option("runs/<first data file>")]
OutByLog = Annotated[Path | None, out_option("runs/<first log>-runs")]
OutByVessel = Annotated[Path | None, out_option("runs/<vessel>-indices")]
OutByCard = Annotated[Path | None, out_option("runs/<card>-nominal")]
OutInclined = Annotated[Path | None, out_option("runs/<vessel>-incline")]
OutWhatIf = Annotated[Path | None, out_option("runs/<scenario>-whatif")]

ScenarioFile = Annotated[
    Path,
    Argument(
        metavar="SCENARIO.toml", help="Names vessel, dictionary and area; see expdesign explain scenario for its keys."
    ),
]
OtherVessel = Annotated[
    Path | None,
    Option(
        "--vessel",
        metavar="VESSEL.toml",
        help="In place of the vessel file that the scenario names, e.g. vessel-steps.toml or vessel-estimated.toml.",
    ),
]
PlanFile = Annotated[
    Path,
    Argument(metavar="PLAN.json", help="A plan made before; its track.csv and commands.csv must lie beside it."),
]
DataFiles = Annotated[
    tuple[Path, ...],
    Argument(
        metavar="DATA.csv ...", help="Measured runs, or folders of them; see expdesign explain data for their columns."
    ),
]
SEED = Option("--seed", parser=parse_seed, metavar="N", help="Seed of all random numbers; same seed, same result.")
Seed = Annotated[int, SEED]
StatedSeed = Annotated[int, replace(SEED, stated=True)]
MOST_TRIALS = 100_000  # simulated trials of a design, or of a manoeuvre, at most
MOST_VOYAGES = 1000  # simulated voyages of each change in operation, at most
Jobs = Annotated[int, Option("--jobs", parser=parse_jobs, metavar="N", help="Number of processes; 0 for one per core.")]
Scheduler = Annotated[
    str | None,
    Option("--scheduler", metavar="ADDRESS", help="Dask scheduler to compute on instead, e.g. tcp://host:8786."),
]
NoCache = Annotated[
    bool,
    Option(
        "--no-cache",
        help="Neither read nor keep results of earlier commands, as with EXPDESIGN_CACHE=off. That variable may also "
        "name the folder for them. Default: ~/.cache/expdesign, at most 256 MiB.",
    ),
]
Resume = Annotated[
    bool,
    Option(
        "--resume",
        help="Go on from the state that an earlier watch left in the same folder, however it ended. Rows that it had "
        "read are skipped: give the same file, grown or not, the next one, or the stream from before its end.",
    ),
]
Fixed = Annotated[
    tuple[str, ...],
    Option("--fixed", metavar="NAME ...", help="Parameters kept at the vessel file's values."),
]
Velocity = Annotated[
    Literal["auto", "measured", "difference", "smoothed"],
    Option(
        metavar="HOW",
        help="Source of u, v, r: measured; difference or smoothed, both from the pose; auto: measured where there are "
        "such columns, else difference.",
    ),
]
Mean = Annotated[
    Literal["complete", "batch", "none"],
    Option(
        metavar="HOW",
        help="Mean subtracted from the instruments, against constant disturbances: complete, batch or none. Use none "
        "where an input never changes.",
    ),
]
Throttle = Annotated[
    tuple[str, ...],
    Option(
        "--throttle",
        metavar="NAME ...",
        help="Signals whose mean drives the vessel, e.g. n1. Default: all n, else tau_x.",
    ),
]
Rudder = Annotated[
    tuple[str, ...],
    Option(
        "--rudder",
        metavar="NAME ...",
        help="Signals whose mean turns it. Default: all rudder, else all a, else tau_psi, else half the difference "
        "of the first and the last n.",
    ),
]
