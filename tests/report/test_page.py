from html.parser import HTMLParser

from cfem.report.page import Picture, Section, Table, page
from cfem.report.tables import number, tracking_table


class Balanced(HTMLParser):
    """Collects tags and demands that they close in order."""

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def make():
    picture = Picture(b"\x89PNG", 'A "tip" <moves> & bends')
    table = Table(("model", "loss"), [("a<b", "1")])
    return page("robot <1>", "lead", [Section("S", "text", (picture, table, (picture, picture)))])


def test_the_page_is_well_formed_and_stands_alone():
    parser = Balanced()
    parser.feed(make())
    assert parser.open == []
    tags = [tag for tag, _ in parser.seen]
    assert tags.count("img") == 3
    assert "script" not in tags and "link" not in tags
    assert all(
        attrs["src"].startswith("data:image/png;base64,") and attrs["alt"] for tag, attrs in parser.seen if tag == "img"
    )


def test_what_users_wrote_is_escaped():
    html = make()
    assert "robot &lt;1&gt;" in html and "a&lt;b" in html and "<moves>" not in html


def test_numbers_read_well():
    assert [number(v) for v in (None, 0, 1.23456, 150.04, 4567.8, 2.5e-7, 3e8)] == [
        "–", "0", "1.23", "150", "4568", "2.50·10⁻⁷", "3.00·10⁸",
    ]  # fmt: skip


def test_a_controller_without_reachable_goals_has_a_dash():
    result = {
        "reachable": 0,
        "goals": 3,
        "distance_to_reachable_goals": None,
        "distance_to_fe_based": {"mean": 0.01, "max": 0.02},
        "iterations_mean": 2.5,
        "step_us": {"median": 100.0, "p99": 200.0},
        "kkt_max": 1e-12,
    }
    (row,) = tracking_table({"arc": {"spectral": result}}).rows
    assert row[2:5] == ("0 of 3", "–", "0.01 / 0.02")
