"""The command line that repeats a call, for reports and files."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from types import MappingProxyType

NOTHING: Mapping[str, object] = MappingProxyType({})


def command_text(
    command: str, words: Iterable[object], options: Mapping[str, object], *, usual: Mapping[str, object] = NOTHING
) -> str:
    """`expdesign COMMAND WORDS OPTIONS`, ready to be typed.

    Args:
        command: name of the command.
        words: its arguments.
        options: option -> value; a list gives several words, True none. What is None, False or empty is left out.
        usual: defaults by option; values that equal them are left out, too.
    """
    spelled = ["expdesign", command, *map(str, words)]
    for option, value in options.items():
        if value is None or value is False or value == () or (option in usual and value == usual[option]):
            continue
        values = value if isinstance(value, tuple) else () if value is True else (value,)
        spelled += [option, *(f"{item:g}" if isinstance(item, float) else str(item) for item in values)]
    return shlex.join(spelled)
