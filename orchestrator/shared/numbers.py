"""Numbers as text that somebody will copy."""


def exact_text(value: float) -> str:
    """Return a number with all its digits, as TOML and the command line read it."""
    return str(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))
