"""What remains beside all causes of the catalogue: terms that models may get, and kinds of what is missing.

`missing_effects` finds a sparse sum of them by stability selection; `with_unlisted_terms` adds terms to a selection.
"""

from expdesign.diagnosis.remainder.search import Missing, Remainder, missing_effects, with_unlisted_terms
