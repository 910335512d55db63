from cfem.report.sections.vibrations import vibrations_chart, vibrations_table


def rows():
    stable = {"delta_a": [1.0], "frequency": [5.0, 12.5], "damping": [0.1, 0.234]}
    return {"held": [stable, stable], "free": [stable, {"delta_a": [1.0], "frequency": [], "damping": [], "why": "x"}]}


def test_a_row_tells_frequencies_and_damping_and_where_the_robot_is_unstable():
    table = vibrations_table(rows(), {"left": "mm"})
    assert table.head == ("state", "left (mm)", "held: Hz (damping)", "free: Hz (damping)")
    assert table.rows[0] == ("1", "1", "5 (10 %), 12.5 (23 %)", "5 (10 %), 12.5 (23 %)")
    assert table.rows[1][3] == "unstable"


def test_a_panel_for_held_actuators_and_one_for_free_ones():
    assert len(vibrations_chart("finger", rows()).panels) == 2
    never = {"delta_a": [1.0], "frequency": [], "damping": [], "why": "x"}
    assert len(vibrations_chart("finger", {"held": [never], "free": [never]}).panels) == 2
