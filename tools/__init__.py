"""Programs for developers of the project."""

import argparse


def refuse_arguments(text: str | None) -> None:
    """End a program that takes no arguments where it is given one; ``--help`` shows the text."""
    formatted = argparse.RawDescriptionHelpFormatter
    argparse.ArgumentParser(description=text, formatter_class=formatted).parse_args()
