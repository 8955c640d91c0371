"""Which command lines a page may ask for: commands, their files, and the options that the workbench offers."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from orchestrator.errors import InputError
from orchestrator.estimation.protocol import METHODS
from orchestrator.workbench.session import SessionFolder

MOST_INPUTS, MOST_EFFECTS = 20, 100
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


@dataclass(frozen=True)
class CommandForm:
    """A command as pages may ask for it."""

    inputs: tuple[int, int]  # least and most number of files
    # how the value of each option becomes text; an empty text is an option without a value
    options: Mapping[str, Reader] = field(default_factory=dict)
    words: tuple[str, ...] = ()  # that stand behind the command's name


_READING: dict[str, Reader] = {
    "part": _part, "resample": _one_of("uniform", "linear", "cubic"), "rate": _number, "header": _number,
}  # fmt: skip
FORMS: dict[str, CommandForm] = {
    "inspect": CommandForm((1, 1), {"model": _file, **_READING}),
    "estimate": CommandForm(
        (0, MOST_INPUTS),
        {
            "model": _file, "motor_only": _flag, "time_limit": _number, "no_diagnose": _flag,
            "method": _one_of(*METHODS, "all"), "design": _flag, "size": _number, "torque_limit": _number,
            "speed_limit": _number, "duration": _number, **_READING,
        },
    ),
    "diagnose": CommandForm(
        (1, MOST_INPUTS),
        {
            "model": _file, "settings": _file, "fmu": _file, "map": _file, "draft_map": _flag, "validate": _file,
            "test": _file, "no_search": _flag, "effects": _effects, "time_limit": _number,
            **_READING,
        },
    ),
    "calibrate": CommandForm((1, 1), {"fmu": _file, "map": _file}),
    "check": CommandForm((1, MOST_INPUTS), {"static": _flag, "time_limit": _number}),
    "simulate": CommandForm((0, 0), {"scenario": _file, "time_limit": _number}),
    "compensate": CommandForm(
        (0, 0), {"model": _file, "impact_speed": _number, "torque_limit": _number, "native": _flag, "force": _flag}
    ),
    "regulator": CommandForm((0, 0), {"model": _file}),
    "ssp": CommandForm((1, 1), {"time_limit": _number}, ("run",)),
}  # fmt: skip


def command_line(session: SessionFolder, command: Any, inputs: Any, options: Any) -> list[str]:
    """Return the words behind the program's name, without ``--out``; paths are relative to the session's directory.

    Raises:
        InputError: the workbench does not offer this, or a file is none of this session's.
    """
    form = FORMS.get(command) if isinstance(command, str) else None
    if form is None:
        raise InputError(f"`command` must be one of {', '.join(FORMS)}, but is {str(command)[:60]!r}")
    least, most = form.inputs
    if not isinstance(inputs, Sequence) or isinstance(inputs, str) or not least <= len(inputs) <= most:
        raise InputError(f"`inputs` must be {least} to {most} files of this session")
    if not isinstance(options, Mapping):
        raise InputError("`options` must be a table")
    words = [str(command), *form.words]
    for name, value in options.items():
        reader = form.options.get(name)
        if reader is None:
            known = ", ".join(form.options) or "none"
            raise InputError(f"`{str(name)[:60]}` must be an option of the workbench ({known}), but is not")
        text = reader(value, name, session)
        if text is not None:  # `--rate=100`: no value can be taken for an option
            words.append(f"--{name.replace('_', '-')}" + (f"={text}" if text else ""))
    return [*words, *(_file(one, "inputs", session) for one in inputs)]
