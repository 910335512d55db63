"""What a controller over time is where its spec says nothing."""

from cfem.control.closed_loop.spec import ControllerSpec


def test_a_tick_takes_one_inverse_step_as_in_the_paper_from_the_equilibrium_of_its_command():
    spec = ControllerSpec(mode="closed")
    assert (spec.iterations, spec.observer, spec.gains) == (1, "equilibrium", None)
