"""The reach of each actuator is asked for, with the stroke that was found and the reason of each."""

import pytest
from support.blocks import bar

from cfem.core.errors import SpecError
from cfem.init import stroke
from cfem.init.drive import Drive
from cfem.init.question import answer
from cfem.init.reach import reaches
from cfem.init.stroke import Stroke


class TestWhatIsAsked:
    @pytest.fixture
    def robot(self, monkeypatch):
        ends = [Stroke(4.0, 1.0, "bent"), Stroke(9.0, 2.5, "strained")]
        monkeypatch.setattr(stroke, "find_strokes", lambda robot, advance: ends)
        return bar("tet4", divisions=(6, 1, 1))

    def asked(self, robot, text=None):
        questions = []

        def ask(question):
            questions.append(question)
            return answer(question, text)

        stated = () if text is None else ("reach",)
        answers, contact = reaches(robot, Drive(cables=(None, None)), 0, stated, ask, "a coarse mesh")
        assert contact is None
        return answers, questions[0]

    def test_unlike_strokes_are_suggested_one_by_one_with_the_reason_of_each(self, robot):
        (first, second), question = self.asked(robot)
        assert (first.value, second.value, question.default) == (4.0, 9.0, "4 mm, 9 mm")
        assert first.guess == "bent, at 1 N on a coarse mesh"
        assert second.guess == "strained, at 2.5 N on a coarse mesh"
        assert question.why == f"cable-0: {first.guess}; cable-1: {second.guess}"

    def test_one_amount_is_for_all_and_as_many_as_there_are_for_each(self, robot):
        assert [each.value for each in self.asked(robot, "7 mm")[0]] == [7, 7]
        stated = self.asked(robot, "7 mm, 1 cm")[0]
        assert [(each.value, each.guess) for each in stated] == [(7, None), (10, None)]
        with pytest.raises(SpecError, match="expected one quantity for all, or 2 with commas, got '1 mm, 2 mm, 3 mm'"):
            self.asked(robot, "1 mm, 2 mm, 3 mm")
