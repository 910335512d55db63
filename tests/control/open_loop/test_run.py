"""What `cfem control` says of an object."""

from types import SimpleNamespace

from cfem.control.open_loop.run import _account


def test_how_an_object_is_held_is_stated_where_it_was_solved_for():
    fem = SimpleNamespace(solves=3, imbalance=2e-10, softest=0.05, updates=7)
    held, lines = _account(fem, None)
    assert held == {"imbalance": 2e-10, "softest": 0.05, "updates": 7}
    assert len(lines) == 1 and "balance to 2.0e-10" in lines[0] and "5.0e-02 of the stiffness" in lines[0]


def test_how_an_object_is_touched_comes_beside_it():
    touched = SimpleNamespace(account=lambda: {"commands": 2})
    held, lines = _account(SimpleNamespace(solves=0), touched)
    assert held == {"commands": 2} and lines == []
