"""Remedies of a refusal: changes of one key for which the test that failed passes, each checked by that test.

Few changes are tried, the most promising first, so that looking for a remedy takes no longer than planning. The refusal
says what was not tried, and where no remedy could be checked.
"""

from expdesign.plan.remedies.advice import advised
