"""Hooks of MkDocs: pages beside ``docs/`` and the page of messages join the site, and formulae become MathML."""

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

from tools import messages_page

ROOT = Path(__file__).resolve().parents[1]
# Pages of the repository outside of docs/, and their names on the site.
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changes.md",
    "fmus/README.md": "fmu-interfaces.md",
    "fmus/halves/README.md": "half-drivetrains.md",
}
# Further files of the repository that pages link to.
FILES = ("LICENSE", "fmus/halves/reference.csv", "fmus/halves/contacts.csv")
LINK = re.compile(r"(?<=\]\()(?![a-z]+:)([^)#\s]+)")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_files(files: Any, config: Any) -> Any:
    """Add the pages outside of ``docs/``, and the page of messages."""
    for source, name in PAGES.items():
        files.append(File.generated(config, name, abs_src_path=str(ROOT / source)))
    files.append(File.generated(config, "messages.md", content=messages_page.page()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Point the links of a page at the places that their targets have on the site."""
    sources = {name: source for source, name in PAGES.items()}
    source = ROOT / sources.get(page.file.src_uri, f"docs/{page.file.src_uri}")

    def target_on_site(match: re.Match[str]) -> str:
        target = Path(source.parent, match[1]).resolve().relative_to(ROOT).as_posix()
        place = PAGES.get(target, target.removeprefix("docs/"))
        return "../" * page.file.src_uri.count("/") + place

    return LINK.sub(target_on_site, markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Turn formulae into MathML, which browsers show without a script."""

    def as_mathml(match: re.Match[str]) -> str:
        return convert(html.unescape(match[2]), display="block" if match[1] == "div" else "inline")

    return FORMULA.sub(as_mathml, content)
