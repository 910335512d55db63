from cfem.stability.case import Case, converges
from cfem.stability.evidence import Evidence
from cfem.stability.suite import Result
from cfem.stability.table import as_data, as_text


def test_a_residual_stands_beside_what_the_answer_says_is_allowed():
    found = Evidence("CONVERGED", True, residual=5e-8, tolerance=1e-7, rounding=1e-7)
    result = Result(Case("contrast/insert", converges(), lambda: None), found, None, (), 0.1)
    header, line = as_text([result]).splitlines()[:2]
    assert header.split() == ["contrast", "status", "residual", "allowed"]
    assert line.split() == ["insert", "CONVERGED", "5.0e-08", "1.0e-07"]
    assert as_data([result])["table"][0]["tolerance"] == 1e-7
