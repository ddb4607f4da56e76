"""The dictionary: manoeuvre families and the primitives made from them."""

from expdesign.dictionary.build import build_dictionary, build_primitive, family
from expdesign.dictionary.families import FAMILIES
from expdesign.dictionary.spec import Family, Primitive, PrimitiveSpec, Setting, complete_settings
