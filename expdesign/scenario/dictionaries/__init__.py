"""Dictionary files, and the command files of recorded primitives."""

from expdesign.scenario.dictionaries.dictionary_file import NAME, NAME_RULE, load_dictionary

__all__ = ["NAME", "NAME_RULE", "load_dictionary"]
