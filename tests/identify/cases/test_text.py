"""What a person reads about a calibration by load cases."""

from cfem.identify.cases.text import headline


def test_intervals_are_stated_with_the_confidence_that_was_asked_for():
    entry = {"value": 1.2, "unit": "MPa", "interval": [1.1, 1.3]}
    models = {"kept": {"left_out_mm": None}}
    results = {"estimates": {"E": entry}, "untold": [], "models": models, "left_out_within": (0.8, 0.9)}
    first, _, shares = headline(results | {"best": None, "repeats_mm": None}, in_fit=0.5, confidence=0.8)
    assert first == "E 1200 kPa, 80 % interval [1100, 1300]"
    assert "within their 80 % intervals" in shares
