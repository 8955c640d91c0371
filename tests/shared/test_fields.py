"""A field of a result is described once: tables, facts and text follow, and JSON stays what it is."""

import math
from typing import Annotated

import msgspec
import pytest

from orchestrator.api.shown import plain_block
from orchestrator.shared.results import TrustFound, as_plain
from orchestrator.shared.results.fields import Display, TableColumn, displays, fields_table


class Gear(msgspec.Struct, frozen=True):
    name: Annotated[str, Display("gear")]
    share: Annotated[float | None, Display("loss", "%", 3, factor=100.0)]
    interval: Annotated[tuple[float | None, float | None] | None, Display("95 % from", "rad", to="to")] = None
    trust: Annotated[TrustFound | None, Display("trust")] = None
    words: Annotated[tuple[str, ...], Display("words")] = ()
    inner: int = 0


GEARS = (Gear("a", 0.0312345, (0.1, math.inf), TrustFound("green"), ("x", "y"), 7), Gear("", math.nan))
HEADS = ("gear", "loss [%]", "95 % from [rad]", "to [rad]", "trust", "words")


def test_a_table_has_the_fields_that_are_told_in_their_order():
    table = fields_table("Gears", GEARS, "A note.")
    assert tuple(column.heading for column in table.columns) == HEADS
    assert table.columns[1] == TableColumn("loss", "%", 3)
    assert table.rows[0] == ("a", pytest.approx(3.12345), 0.1, None, "green", "x, y")
    assert table.rows[1] == (None,) * 6
    assert (table.title, table.note) == ("Gears", "A note.")
    assert "inner" not in displays(Gear)


def test_of_a_mapping_the_names_come_first_and_no_item_leaves_the_head():
    table = fields_table("Gears", {"first": GEARS[0]}, names="place")
    assert (table.columns[0].name, table.rows[0][:2]) == ("place", ("first", "a"))
    assert len(fields_table("Gears", (), of=Gear).columns) == len(HEADS)


def test_text_has_the_digits_of_the_description():
    shown = plain_block(fields_table("Gears", GEARS))
    assert shown.columns == HEADS
    assert shown.rows == (("a", "3.12", "0.1", "–", "green", "x, y"), ("–",) * 6)


def test_json_is_not_touched_by_a_description():
    assert as_plain(GEARS[0])["share"] == 0.0312345
    assert msgspec.convert(as_plain(GEARS[0]), Gear).inner == 7


def test_columns_are_added_and_empty_ones_left_out():
    table = fields_table("Gears", GEARS[:1]).with_column(TableColumn("odd"), [None])
    assert [c.name for c in table.without_empty_columns().columns] == ["gear", "loss", "95 % from", "trust", "words"]
