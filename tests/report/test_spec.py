"""A report from somewhere else: its sections' names are text in pictures and names of files."""

import pytest
from pydantic import ValidationError

from cfem.report.spec import ReportSpec

HOSTILE = ["../../evil", "a/b", "a\\b", "$x_{", "<script>", "a\nb", "\x1b[2J", "", "x" * 101]
SECTIONS = {
    "loops": lambda name: {"loops": {name: "run"}},
    "sampling": lambda name: {"sampling": {name: {"spectral": ["m"]}}},
    "sampling, models": lambda name: {"sampling": {"grid": {name: ["m"]}}},
    "surrogates": lambda name: {"surrogates": {name: {"models": {"spectral": "m"}}}},
    "surrogates, models": lambda name: {"surrogates": {"finger": {"models": {name: "m"}}}},
    "meshes": lambda name: {"meshes": {name: {"mesh": "a", "model": "b", "control": "c"}}},
    "models": lambda name: {"loops": {"a": "b"}, "models": {name: "m"}},
}


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("name", HOSTILE)
def test_names_that_leave_the_folder_or_are_no_text_are_refused(section, name):
    with pytest.raises(ValidationError, match="1 to 100 characters"):
        ReportSpec.model_validate({"out": "page", **SECTIONS[section](name)})


@pytest.mark.parametrize("section", [name for name in SECTIONS if name != "models"])
@pytest.mark.parametrize("name", ["spectral of forces", "7.7 mm", "circle-5hz", "Prüfling (neu), 3"])
def test_names_as_people_give_them(section, name):
    ReportSpec.model_validate({"out": "page", **SECTIONS[section](name)})
