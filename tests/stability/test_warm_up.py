from cfem.mechanics.material import LAWS
from cfem.stability import bodies, warm_up
from cfem.stability.bodies import bar_body


def test_every_law_is_solved_and_machine_code_is_then_found(monkeypatch):
    seen = []
    monkeypatch.setattr(warm_up, "ELEMENTS", ("hex8",))
    monkeypatch.setattr(bodies, "bar_body", lambda element, law: seen.append(law) or bar_body(element, law))
    warm_up.warm_up()
    assert seen == list(LAWS) and warm_up.is_warm()
