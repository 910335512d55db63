"""What the manifest of a dataset says of its rows."""

import pyarrow as pa
import pytest

from cfem.core.errors import NumericalError
from cfem.sample.artefact import results


def rows(failed, solved=24):
    n = failed + solved
    return pa.table(
        {
            "status": ["step-too-small"] * failed + ["converged"] * solved,
            "reason": ["stopped at 60 % of the way"] * failed + [""] * solved,
            "residual": [1e-3] * failed + [1e-12] * solved,
            "seconds": [1.0] * n,
            "factorizations": [2] * n,
            "iterations": [2] * n,
        }
    )


def test_more_than_one_failed_row_in_twenty_is_judged():
    assert results({"train": rows(1), "test": rows(1)})["judgement"] == []
    (judged,) = results({"train": rows(12, 12), "test": rows(0)})["judgement"]
    assert judged["what"].startswith("12 of 48 states failed, 25 %")
    assert "stopped at 60 % of the way" in judged["what"]


def test_a_split_without_any_converged_row_is_no_dataset():
    with pytest.raises(NumericalError, match="no row of 'test' converged: stopped at 60 %"):
        results({"train": rows(0), "test": rows(3, 0)})
