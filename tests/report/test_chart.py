import re
from itertools import pairwise

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from cfem.report.chart import HEIGHT, TEXT, THEME, WIDTH, chart, panel
from cfem.report.style import FE, LEARNED, grid, outside_legend, png, tick


def make(**look):
    axis = panel("loss", "samples", log="xy")
    axis.plot([10, 100, 1000], [1e-3, 1e-7, 1e-9], "o--", color=LEARNED[0], label="spectral", **look)
    axis.plot([10], [1e-3], "*", color=FE, label="a paper <1>")
    return chart("errors", "Errors & costs", [axis, panel("tip (mm)", "samples")])


def test_all_panels_and_letters_have_one_size():
    html = make().html()
    sizes = re.findall(r'<svg role="img"[^>]* width="(\d+)" height="(\d+)"', html)
    assert sizes == [(str(WIDTH), str(HEIGHT))] * 2
    assert set(re.findall(r"font-size: (\w+)", html)) == {f"{TEXT}px"}


def test_colours_follow_the_theme_and_files_are_those_of_paper():
    found = make()
    colours = set(re.findall(r"(var\(--\w+, )?(#[0-9a-f]{6})", found.html()))
    assert all(variable for variable, _ in colours) and {colour for _, colour in colours} <= set(THEME)
    files = found.files()
    assert list(files) == ["errors-1.svg", "errors-2.svg"]
    assert b"var(" not in files["errors-1.svg"] and LEARNED[0].encode() in files["errors-1.svg"]


def test_the_legend_shows_each_label_once_with_its_line_and_mark():
    legend = make().legend
    assert legend.count("<li>") == 2 and "a paper &lt;1&gt;" in legend
    line, star = legend.split("</li>")[:2]
    assert 'stroke-dasharray="5 3"' in line and "<circle" in line and "var(--c0" in line
    assert "dasharray" not in star and "var(--fe" in star


def test_the_same_chart_is_the_same_text_and_panels_share_no_names():
    assert make().panels == make().panels
    parts = make().html().split("<svg role")[1:]
    one, other = (set(re.findall(r'id="(\w+)"', part)) for part in parts)
    assert one and not one & other


@pytest.mark.parametrize("name", ["$...{", "$x^$", "${name}", "\\frac{1}{2}", "<script>"])
def test_names_are_drawn_as_they_are(name):
    axis = panel(name, name)
    axis.plot([1, 2], [1, 2], color=LEARNED[0], label=name)
    axis.plot([1, 2], [1, 2], color=FE, label="other")
    html = chart(name, name, [axis]).html()
    assert name.replace("<", "&lt;").replace(">", "&gt;") in html and "<script>" not in html


def test_ticks_are_plain_numbers_or_powers_of_ten():
    assert [tick(v) for v in (0.05, 20.0, 1e-5, 2e-7, 1.5e-10)] == ["0.05", "20", "10⁻⁵", "2·10⁻⁷", "1.5·10⁻¹⁰"]
    assert [tick(v) for v in (0.0, -0.5, -2e-5)] == ["0", "−0.5", "−2·10⁻⁵"]
    assert "10⁻⁹" in make().panels[0] and ">1000<" in make().panels[0]


@pytest.mark.parametrize("name", ["$...{", "${name}", "\\frac{1}{2}"])
def test_pictures_of_other_stages_take_any_name_too(name):
    figure, (axis,) = grid(1)
    axis.semilogy([1, 2], [1e-9, 1], label=name)
    axis.set(xlabel=name, title=name)
    outside_legend(axis)
    assert png(figure).startswith(b"\x89PNG")


def test_a_linear_axis_of_small_numbers_has_no_common_factor_over_its_title():
    axis = panel("force (N)", "goal")
    axis.plot([0, 1], [-2e-5, 2e-5])
    text = chart("small", "", [axis]).panels[0]
    assert ">−2·10⁻⁵<" in text and "1e" not in text.replace("1em", "")


def test_labels_of_numbers_that_are_nearly_alike_stand_apart():
    axis = panel("y (mm)", "x (mm)")
    axis.plot([58.45, 58.525, 58.597], [0.06, 0.04, 0.01])
    FigureCanvasAgg(axis.figure).draw()
    low, high = axis.get_xlim()
    boxes = [
        one.label1.get_window_extent()
        for one in axis.xaxis.get_major_ticks()
        if low <= one.get_loc() <= high and one.label1.get_text()
    ]
    assert len(boxes) >= 3
    assert all(left.x1 + 4 < right.x0 for left, right in pairwise(boxes))
