"""``fmus/README.md`` documents the interfaces that the built FMUs have."""

from pathlib import Path

from orchestrator.building.build import ensure_built
from tools.interface_tables import PAGE, tables, with_tables


def test_the_page_is_the_built_interfaces() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert with_tables(page, tables(ensure_built())) == page, "run `python -m tools.interface_tables`"


def test_a_change_of_an_interface_shows(fmus: dict[str, Path]) -> None:
    page, text = PAGE.read_text(encoding="utf-8"), tables(fmus)
    for name in fmus:
        assert f"## {name}\n" in page
    assert "| `theta_m` | rad |" in text
    assert with_tables(page, text.replace("Motor angle as measured", "Something else")) != page
