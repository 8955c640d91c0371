"""Which command lines a page may ask for: commands, their files, and the options that the workbench offers."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from orchestrator.errors import InputError
from orchestrator.estimation.protocol import METHODS
from orchestrator.workbench.session import SessionFolder

MOST_INPUTS, MOST_EFFECTS = 20, 100
# A parameter of an instance, and the values that it takes.
_VALUES = re.compile(r"[^=,\s][^=,]*=(?:range|logrange):[-+.e\d]+:[-+.e\d]+:\d{1,4}")
Reader = Callable[[Any, str, SessionFolder], str | None]


def _file(value: Any, name: str, session: SessionFolder) -> str:
    if not isinstance(value, str):
        raise InputError(f"`{name}` must be a file of this session, but is {str(value)[:60]!r}")
    return session.reference_of(session.path_of(value))


def _number(value: Any, name: str, session: SessionFolder) -> str:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"`{name}` must be a finite number, but is {str(value)[:60]!r}")
    return repr(value)


def _flag(value: Any, name: str, session: SessionFolder) -> str | None:
    if not isinstance(value, bool):
        raise InputError(f"`{name}` must be true or false, but is {str(value)[:60]!r}")
    return "" if value else None


def _one_of(*known: str) -> Reader:
    def read(value: Any, name: str, session: SessionFolder) -> str:
        if value not in known:
            raise InputError(f"`{name}` must be one of {', '.join(known)}, but is {str(value)[:60]!r}")
        return str(value)

    return read


def _part(value: Any, name: str, session: SessionFolder) -> str:
    if not isinstance(value, str) or len(value) > 40 or not set(value) <= set("0123456789.:e+"):
        raise InputError(f"`{name}` must be START:END in seconds, such as 2:30, but is {str(value)[:60]!r}")
    return value


def _effects(value: Any, name: str, session: SessionFolder) -> str:
    if not isinstance(value, list) or len(value) > MOST_EFFECTS or not all(map(_is_effect, value)):
        raise InputError(f"`{name}` must be a list of effects such as backlash@shaft, but is {str(value)[:60]!r}")
    return ",".join(value) or "none"


def _is_effect(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= 300 and value.isprintable() and "@" in value


def _values(value: Any, name: str, session: SessionFolder) -> str:
    if not isinstance(value, str) or len(value) > 300 or not _VALUES.fullmatch(value):
        raise InputError(f"`{name}` must be such as plant.alpha=range:0:0.05:6, but is {str(value)[:60]!r}")
    return value


# How the value of each option becomes text; an empty text is an option without a value.
OPTIONS: Mapping[str, Reader] = {
    **dict.fromkeys(("model", "settings", "fmu", "map", "validate", "test", "scenario"), _file),
    **dict.fromkeys(
        ("motor_only", "no_diagnose", "design", "draft_map", "no_search", "static", "native", "force"), _flag
    ),
    **dict.fromkeys(
        ("rate", "header", "time_limit", "size", "torque_limit", "speed_limit", "duration", "impact_speed"), _number
    ),
    "part": _part,
    "resample": _one_of("uniform", "linear", "cubic"),
    "method": _one_of(*METHODS, "all"),
    "effects": _effects,
    "vary": _values,
}
_READING, _LIMITS = "part resample rate header", "size torque_limit speed_limit duration"
# Of each command that a page may ask for: least and most number of files, and its options.
FORMS: Mapping[str, tuple[int, int, str]] = {
    "inspect": (1, 1, f"model {_READING}"),
    "estimate": (0, MOST_INPUTS, f"model motor_only time_limit no_diagnose method design {_LIMITS} {_READING}"),
    "diagnose": (
        1, MOST_INPUTS, f"model settings fmu map draft_map validate test no_search effects time_limit {_READING}",
    ),
    "calibrate": (1, 1, "fmu map"),
    "check": (1, MOST_INPUTS, "static time_limit"),
    "simulate": (0, 0, "scenario time_limit"),
    "sweep": (0, 0, "scenario vary time_limit"),
    "compensate": (0, 0, "model impact_speed torque_limit native force"),
    "regulator": (0, 0, "model"),
    "ssp": (1, 1, "time_limit"),
}  # fmt: skip


def command_line(session: SessionFolder, command: Any, inputs: Any, options: Any) -> list[str]:
    """Return the words behind the program's name, without ``--out``; paths are relative to the session's directory.

    Raises:
        InputError: the workbench does not offer this, or a file is none of this session's.
    """
    form = FORMS.get(command) if isinstance(command, str) else None
    if form is None:
        raise InputError(f"`command` must be one of {', '.join(FORMS)}, but is {str(command)[:60]!r}")
    least, most, known = form
    if not isinstance(inputs, Sequence) or isinstance(inputs, str) or not least <= len(inputs) <= most:
        raise InputError(f"`inputs` must be {least} to {most} files of this session")
    if not isinstance(options, Mapping):
        raise InputError("`options` must be a table")
    words = [str(command), *(["run"] if command == "ssp" else [])]
    for name, value in options.items():
        if name not in known.split():
            raise InputError(f"`{str(name)[:60]}` must be an option of the workbench ({known}), but is not")
        text = OPTIONS[name](value, name, session)
        if text is not None:  # `--rate=100`: no value can be taken for an option
            words.append(f"--{name.replace('_', '-')}" + (f"={text}" if text else ""))
    return [*words, *(_file(one, "inputs", session) for one in inputs)]
