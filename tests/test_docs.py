"""The pages that people read: short sentences, short pages, links that lead somewhere."""

import ast
import contextlib
import functools
import importlib
import re
from pathlib import Path

import yaml

from tests.support.prose import count_words, sentences
from tools import effects_page, messages_page, settings_page

ROOT = Path(__file__).resolve().parents[1]
GENERATED = {"docs/effects.md", "docs/settings.md", "docs/rules.md", "fmus/README.md"}
CHANGES = "CHANGELOG.md"
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in ("*.md", "docs/**/*.md", "findings/*.md", "fmus/**/*.md", "tools/**/*.md")
    for path in ROOT.glob(pattern)
)
MOST_LINES = 250
MOST_LINES_OF_A_VERSION = 80
MOST_WORDS = 40
MOST_WORDS_ON_AVERAGE = 25


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def test_pages_are_found():
    assert {"README.md", CHANGES, "docs/method.md", "docs/api/functions.md", *GENERATED} <= set(PAGES)


SENTENCES = """# A title

One `x + y` here. Two,
three 0.5 mm!

- four
- five $a + b$

| a | b |
|---|---|
| c | d |

```sh
six
```

    seven

![eight](a.png)
"""


def test_what_counts_as_a_sentence():
    assert [count_words(sentence) for sentence in sentences(SENTENCES)] == [3, 4, 1, 2]


def test_sentences_are_short():
    wrong = []
    for page in PAGES:
        lengths = {sentence: count_words(sentence) for sentence in sentences(text_of(page))}
        wrong += [f"{page}: {words} words: {sentence}" for sentence, words in lengths.items() if words > MOST_WORDS]
        if sum(lengths.values()) > MOST_WORDS_ON_AVERAGE * len(lengths):
            wrong.append(f"{page}: {sum(lengths.values()) / len(lengths):.1f} words a sentence on average")
    assert not wrong


def test_pages_are_short():
    lines = {page: len(text_of(page).splitlines()) for page in {*PAGES} - GENERATED}
    assert not {page: n for page, n in lines.items() if n > MOST_LINES}


def test_versions_of_the_changelog_are_short():
    versions = re.split(r"^## ", text_of(CHANGES), flags=re.MULTILINE)[1:]
    assert len(versions) >= 2
    assert not [version.split()[0] for version in versions if len(version.splitlines()) > MOST_LINES_OF_A_VERSION]


def test_links_lead_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)", text_of(page)):
            if "://" not in target:
                assert (ROOT / page).parent.joinpath(target).exists(), f"{page}: {target}"


def missing_names(text):
    """Names such as ``oc.simulate`` and ``orchestrator.engine`` in code spans that lead to nothing."""
    found = re.findall(r"`((?:oc|orchestrator)(?:\.\w+)+)", text)
    return [name for name in found if not _leads_somewhere("orchestrator" + name[name.index(".") :])]


def _leads_somewhere(name):
    for parts in range(name.count(".") + 1, 0, -1):
        first, *more = name.rsplit(".", name.count(".") + 1 - parts)
        with contextlib.suppress(ImportError):
            thing = importlib.import_module(first)
            return functools.reduce(lambda x, part: getattr(x, part, None), more, thing) is not None
    return False


def test_names_in_code_lead_somewhere():
    missing = {page: missing_names(text_of(page)) for page in PAGES if page != CHANGES}
    assert not {page: names for page, names in missing.items() if names}


def test_names_that_lead_nowhere_are_found():
    text = "`oc.simulate(FILE)`, `oc.simulated`, `orchestrator.engine`, `orchestrator.scenarios.scenario.run_scenario`"
    assert missing_names(text) == ["oc.simulated", "orchestrator.scenarios.scenario.run_scenario"]


def test_the_glossary_has_each_term_once_and_stays_short():
    rows = text_of("docs/naming.md").partition("## Glossary")[2]
    terms = re.findall(r"^\| ([^|]+) \|", rows, re.MULTILINE)[1:]
    assert 40 <= len(set(terms)) == len(terms) <= 80


def test_generated_pages_are_current():
    for tool in (effects_page, settings_page):
        assert tool.PAGE.read_text(encoding="utf-8") == tool.page(), f"run `python -m {tool.__name__}`"


def test_the_page_of_messages_has_all_its_sections():
    titles = set(re.findall(r"^## (.+)", messages_page.page(), re.MULTILINE))
    # No message is given to the bare class of connections that do not match.
    empty = {messages_page.ERRORS["ConnectionMismatchError"]}
    assert titles == {*messages_page.ERRORS.values(), messages_page.NOTES, messages_page.FINDINGS} - empty


MESSAGES = """
class RecordError(Exception):
    pass


def read(path, size):
    text = f"`size` must be positive, but is {size}"
    if size < 0:
        raise RecordError(text if path else "`path` must be given, but is not")
    notes = [f"the record has {size} rows" for _ in range(size)]
    notes.append(explain(size) + ": record it again")


def explain(size):
    return f"only {size} rows move"


class DerivedError(RecordError):
    pass


def fail():
    raise DerivedError("the file " "is damaged")
"""


def test_messages_are_collected_from_errors_and_notes(tmp_path, monkeypatch):
    monkeypatch.setattr(messages_page, "ROOT", tmp_path)
    place = tmp_path / "orchestrator" / "records" / "reading.py"
    place.parent.mkdir(parents=True)
    place.write_text(MESSAGES, encoding="utf-8")
    found = messages_page.collect([place])
    assert {title: sorted({text for text, _ in rows}) for title, rows in found.items() if rows} == {
        "Errors: records": [
            "`path` must be given, but is not", "`size` must be positive, but is …", "the file is damaged"
        ],
        messages_page.NOTES: ["only … rows move", "the record has … rows", "…: record it again"],
    }  # fmt: skip
    assert {room for rows in found.values() for _, room in rows} == {"records"}


def groups_of_the_site():
    """The groups of the site, each with its pages as files of the repository; the page of messages is no file."""
    hooks = ast.parse(text_of("tools/site_hooks.py"))
    pages = next(
        ast.literal_eval(n.value) for n in hooks.body if isinstance(n, ast.Assign) and n.targets[0].id == "PAGES"
    )
    files = {place: file for file, place in pages.items()}
    for group in yaml.safe_load(text_of(".mkdocs.yml"))["nav"]:
        ((title, inside),) = group.items()
        if isinstance(inside, list):
            places = [place for page in inside for place in page.values() if place != "messages.md"]
            yield title, [files.get(place, f"docs/{place}") for place in places]


def test_the_readme_has_every_page_in_its_group():
    rows = dict(re.findall(r"^\| (\w[\w ]*) \| (\[.*\)) \|$", text_of("README.md"), re.MULTILINE))
    groups = dict(groups_of_the_site())
    assert {title: re.findall(r"\]\((.+?)\)", rows.get(title, "")) for title in groups} == groups
    listed = {page for pages in groups.values() for page in pages}
    assert {page for page in PAGES if page.startswith("docs/")} <= listed
