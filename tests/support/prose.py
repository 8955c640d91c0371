"""The sentences of a page in Markdown: paragraphs and items of lists, without headings, tables and code."""

import re
from collections.abc import Iterator
from itertools import pairwise

from markdown_it import MarkdownIt

FORMULA = re.compile(r"\$\$?[^$]+\$\$?")
END = re.compile(r"(?<=[.!?])[\"')]*\s+")
SHOWN = {"text": lambda token: token.content, "code_inline": lambda _: "x", "softbreak": lambda _: " "}


def sentences(text: str) -> Iterator[str]:
    """Yield the sentences of a page; code and formulae within them are one word each.

    Args:
        text: of the page.
    """
    tokens = MarkdownIt("commonmark").enable("table").parse(text)
    for before, token in pairwise(tokens):
        if before.type == "paragraph_open":
            shown = "".join(SHOWN[child.type](child) for child in token.children if child.type in SHOWN)
            yield from (part for part in END.split(FORMULA.sub("x", shown)) if count_words(part))


def count_words(sentence: str) -> int:
    """Return how many words a sentence has; a number or a word with a hyphen is one."""
    return sum(any(letter.isalnum() for letter in word) for word in sentence.split())
