import re
from html.parser import HTMLParser

from export.pages import browser, opened, until
from report.synthetic import Text

from cfem.report.page import Card, Number, ReportSection, Summary, page
from cfem.report.tables import ReportTable, durations, lengths, number, spread, tabulate


class Balanced(HTMLParser):
    """Collects tags and demands that they close in order."""

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def make(robot=None, concerns=()):
    table = ReportTable(("model", "loss"), [("a<b", "1")])
    sections = [ReportSection("Tracking <1>", 'a "tip" & more', (table,)), ReportSection("More", "", (table,))]
    summary = Summary("All is reached.", concerns, (Number("3 <mm>", "error", ("largest 4 mm",)),))
    return page("robot ${<1>", summary, robot, Card(Text("<i>body</i>"), {"size": "1 < 2 mm"}), sections)


def test_the_page_is_well_formed_and_loads_nothing():
    parser = Balanced()
    parser.feed(make())
    assert parser.open == []
    attributes = [attrs for _, attrs in parser.seen]
    assert not any({"src", "action"} & set(attrs) for attrs in attributes)
    assert all(attrs["href"].startswith("#") for attrs in attributes if "href" in attrs)
    assert any("default-src 'none'" in attrs.get("content", "") for attrs in attributes)


def test_what_users_wrote_is_escaped():
    html = make()
    for text in ("robot ${&lt;1&gt;", "a&lt;b", "3 &lt;mm&gt;", "1 &lt; 2 mm", "Tracking &lt;1&gt;"):
        assert text in html, text


def test_the_contents_lead_to_every_section():
    html = make()
    assert re.findall(r'<li><a href="#([\w-]+)"', html) == re.findall(r'<details id="([\w-]+)"', html) != []


def test_sections_are_folded_below_a_robot_and_the_first_one_is_open_without():
    assert '<details id="1-tracking-1" open>' in make() and " open>" not in make(Text("robot"))


def test_a_poor_result_is_said_first():
    html = make(concerns=("3 goals are missed.",))
    assert html.index("3 goals are missed.") < html.index("All is reached.")
    assert 'class="poor"' not in make()


def test_numbers_read_well():
    assert [number(v) for v in (None, float("nan"), 0, 1.23456, 150.04, 4567.8, 2.5e-7, 3e8)] == [
        "–", "–", "0", "1.23", "150", "4568", "2.50·10⁻⁷", "3.00·10⁸",
    ]  # fmt: skip
    assert number(114.2, 2) == "114" and number(99.4, 2) == "99"


def test_times_and_lengths_have_the_unit_that_suits_the_largest():
    assert durations({"median": 1234.0, "p99": 56_000.0}) == "1.23 / 56 ms"
    assert lengths({"mean": 2.6e-6, "max": 1.17e-5}) == "2.6 / 11.7 nm"
    assert lengths({"mean": 0.5, "max": None}) == "0.5 mm / –" and lengths(None) == "–"


def test_spreads_with_and_without_numbers():
    assert spread({"mean": 0.5, "max": 2.0}) == "0.5 / 2"
    assert spread({"median": None, "max": None}, "median", "max") == spread(None) == "–"
    assert spread({"median": 3, "max": None}, "median", "max") == "3 / –"


def test_a_column_without_any_text_is_left_out():
    columns = {"name": lambda row: row[0], "empty": lambda row: "–", "size": lambda row: row[1]}
    assert tabulate([("a", "1"), ("b", "–")], columns) == ReportTable(("name", "size"), [("a", "1"), ("b", "–")])


def test_tables_scroll_in_a_box_of_their_own():
    assert ReportTable(("a",), [("1",)]).html().startswith('<div class="scroll"')


def test_a_table_wider_than_a_phone_says_that_it_goes_on(tmp_path):
    wide, narrow = ReportTable(("a long heading",) * 9, [("12345.678",) * 9]), ReportTable(("a", "b"), [("1", "2")])
    (tmp_path / "page.html").write_text(page("x", Summary("s"), None, None, [ReportSection("t", "", (wide, narrow))]))
    with browser() as one:
        tab = opened(one, tmp_path / "page.html", waits=False, viewport={"width": 390, "height": 844})
        shown = "[...document.querySelectorAll('.hint')].map(hint => getComputedStyle(hint).display).join()"
        until(tab, f"{shown} === 'block,none'")
        tab.evaluate("document.querySelector('.scroll').scrollLeft = 9999")
        until(tab, f"{shown} === 'none,none'")
