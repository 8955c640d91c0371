"""Errors are one line that does nothing to a terminal, whatever names and messages they hold."""

import pytest

from orchestrator.errors import ChildError, RecordError, ScenarioError


@pytest.mark.parametrize("kind", [ScenarioError, RecordError, ChildError])
def test_texts_are_one_line_without_control_characters(kind):
    assert str(kind("`a` must be\n b,\r\n but is \x1b[2J\x07\u202e\u2028c")) == (
        "`a` must be b, but is \\x1b[2J\\x07\\u202e c"
    )
    assert str(kind("two  spaces stay, é too")) == "two  spaces stay, é too"
