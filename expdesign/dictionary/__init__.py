"""The dictionary: manoeuvre families and the primitives made from them."""

from expdesign.dictionary.build import build_dictionary, build_primitive, family, trim
from expdesign.dictionary.families import FAMILIES
from expdesign.dictionary.primitive import Primitive
from expdesign.dictionary.spec import Family, PrimitiveSpec, Setting, complete_settings

__all__ = [
    "FAMILIES",
    "Family",
    "Primitive",
    "PrimitiveSpec",
    "Setting",
    "build_dictionary",
    "build_primitive",
    "complete_settings",
    "family",
    "trim",
]
