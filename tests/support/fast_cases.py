"""Some cases of a concept are fast; the others run in the slow suite."""

from collections.abc import Collection, Iterable

import pytest


def fast_are(fast: Collection, cases: Iterable) -> list:
    """The cases as parameters, those that are not `fast` marked as slow; a tuple has a value for each name."""
    values = [case if isinstance(case, tuple) else (case,) for case in cases]
    chosen = [case if isinstance(case, tuple) else (case,) for case in fast]
    return [pytest.param(*value, marks=() if value in chosen else pytest.mark.slow) for value in values]
