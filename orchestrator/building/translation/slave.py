"""A slave's adapter in C: its values and hidden state as a struct, its methods as functions, its tables."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import Any

from orchestrator.building.translation.definitions import Function, Owner, comment_of
from orchestrator.building.translation.directional import directional
from orchestrator.building.translation.functions import translate
from orchestrator.building.translation.kinds import NOTHING, REAL, Items, Kind, Tuple
from orchestrator.building.translation.program import BASE_MODULES, Program
from orchestrator.building.translation.source import read_source
from orchestrator.errors import FmuError

# Hooks that the runtime calls, with their parameters; a slave may lack those marked False.
_PLAIN = {"initialise": ("", True), "advance": (", double time, double step", True), "refresh": ("", False)}
_SAMPLED = {"take_parameters": ("", True), "begin": ("", True), "predict": ("", False), "correct": ("", True)}
# Hooks of a slave with continuous states (it may lack indicators and `begin_exchange`), those that FMI 3.0 wants
# besides, and those of one that follows its inputs.
_CONTINUOUS = {"derivatives": "", "indicators": "", "update": ", double time", "observe": "", "begin_exchange": ""}
_EVENTS = {"advance_to_event": ", double time, double step", "output_rates": ""}
_FOLLOWING = {"take_node": ", int64_t node", "advance_along": ", double time, double step, bool to_event"}
_ARGUMENTS = {
    "advance": "time, step",
    "advance_to_event": "time, step",
    "update": "time",
    "take_node": "node",
    "advance_along": "time, step, to_event",
}
_TYPES = {"Real": "REAL_VALUE", "Integer": "WHOLE_VALUE", "Enumeration": "CHOICE_VALUE"}
_CAUSALITIES = {"input": "INPUT", "output": "OUTPUT", "parameter": "PARAMETER", "local": "LOCAL"}


@dataclass(frozen=True)
class TranslatedSlave:
    """The C of one slave: ``definitions`` come first in the file, ``tables`` before the runtime."""

    types: str
    constants: str
    prototypes: str
    definitions: str
    tables: str


def translate_slave(cls: Any, taken: frozenset[str] = frozenset(), fmi: int = 2) -> TranslatedSlave:
    """Return an adapter (a subclass of ``SlaveBase``), and all that it calls, in C, in parts, for FMI 2 or 3."""
    owner = Owner(cls, attributes_of(cls), len(cls.table))
    program = Program(translate, owner, taken | {cls.__name__})
    sampled = any(base.__name__ == "SampledSlave" for base in cls.__mro__)
    hooks = [_hook(program, name, *hook) for name, hook in (_SAMPLED if sampled else _PLAIN).items()]
    if has_states(cls):
        further = _EVENTS | (_FOLLOWING if getattr(cls, "follows_inputs", False) else {})
        hooks.append(_continuous(program, cls, _CONTINUOUS | (further if fmi == 3 else {})))
    pairs = directional(program, owner) if hasattr(cls, "response") else None
    struct = _struct(program, owner)
    tables = "\n\n".join((variable_table(cls), _lists(program, owner), _settings(cls, owner, sampled, program), *hooks))
    if pairs is None:
        return TranslatedSlave(
            f"{program.types()}\n\n{struct}", program.constants(), program.prototypes(), program.definitions(), tables
        )
    both = (program, pairs.program)
    return TranslatedSlave(
        "\n\n".join((program.types(), '#include "pairs.h"', pairs.program.types(), struct)),
        "\n".join(filter(None, (each.constants() for each in both))),
        "\n".join(each.prototypes() for each in both),
        "\n\n".join(each.definitions() for each in both),
        f"{tables}\n\n{pairs.hook}",
    )


def attributes_of(cls: Any) -> dict[str, Kind]:
    """Return the hidden state of a slave: the attributes that its class declares, with their kinds."""
    found: dict[str, Kind] = {}
    for base in reversed(cls.__mro__):
        if base.__module__ in BASE_MODULES or not base.__module__.startswith("pyfmu_sources."):
            continue
        source = read_source(base.__module__)
        body = next((n for n in source.tree.body if isinstance(n, ast.ClassDef) and n.name == base.__name__), None)
        for node in body.body if body is not None else ():
            if not isinstance(node, ast.AnnAssign) or not isinstance(node.target, ast.Name):
                continue
            if not ast.unparse(node.annotation).startswith("ClassVar"):
                kind = source.annotation(node.annotation, node)
                alike = next((name for name in found if name.lstrip("_") == node.target.id.lstrip("_")), node.target.id)
                if alike != node.target.id:
                    source.refuse(node, f"`{node.target.id}` and `{alike}` must differ in more than underscores")
                found[node.target.id] = kind
    return found


def has_states(cls: Any) -> bool:
    """Tell whether a slave has continuous states, so that it can do model exchange."""
    return bool(getattr(cls, "continuous_states", ()))


def _continuous(program: Program, cls: Any, hooks: dict[str, str]) -> str:
    """Return the hooks of a slave with states, with their parameters, and where the states are."""
    count = len(cls.continuous_states)
    owner = program.owner
    assert owner is not None
    if owner.attributes.get(cls.state_attribute) != Tuple((REAL,) * count):
        raise FmuError(f"`{program.owner_name}.{cls.state_attribute}` must be a tuple of {count} floats")
    made = {name: program.method(None, None, name) for name in hooks if hasattr(cls, name)}
    returned = made["indicators"].returns if "indicators" in made else Tuple(())
    if made["derivatives"].returns != Tuple((REAL,) * count) or not isinstance(returned, Tuple):
        raise FmuError(f"`{program.owner_name}` must return {count} derivatives, and indicators as a tuple of floats")
    nominals = ", ".join(repr(float(nominal)) for _, _, nominal, _ in cls.continuous_states)
    first = next(n for n, variable in enumerate(cls.table) if variable.name == cls.continuous_states[0][0])
    lines = [
        f"#define CONTINUOUS_STATES {count}",
        f"#define INDICATORS {len(returned.items)}",
        f"#define FIRST_STATE {first}",
        f"#define STATES(slave) ((slave)->{program.attribute_name(cls.state_attribute)}.v)",
        f"static const double nominals[] = {{{nominals}}};",
    ]
    if "indicators" not in made:
        lines.append("#define slave_indicators(slave, values, fault) ((void)(slave), (void)(values), (void)(fault))")
    if "begin_exchange" not in made:
        lines.append("#define slave_begin_exchange(slave, fault) ((void)(slave), (void)(fault))")
    if "advance_along" in hooks:
        lines.append("#define FOLLOWS_INPUTS")
    if "output_rates" in hooks:
        lines += _output_rates(program, cls, made["output_rates"])
    functions = (_caller(program, name, hooks[name], function) for name, function in made.items())
    return "\n\n".join(["\n".join(lines), *functions])


def _output_rates(program: Program, cls: Any, function: Function) -> list[str]:
    names = [variable.name for variable in cls.table]
    references = [names.index(name) for name in cls.response_outputs]
    if function.returns != Tuple((REAL,) * len(references)):
        raise FmuError(f"`{program.owner_name}.output_rates` must return a derivative for each of `response_outputs`")
    return [
        f"#define OUTPUT_RATES {len(references)}",
        f"static const Reference rated_outputs[] = {{{', '.join(map(str, references))}}};",
        f"#define HAS_EVENT(slave) ((slave)->{program.attribute_name('_event')} >= 0)",
    ]


def _hook(program: Program, name: str, parameters: str, needed: bool) -> str:
    """Return the function by which the runtime calls a hook, whether it can raise or not."""
    if not needed and not _is_defined(program, name):
        head = f"static void slave_{name}({program.owner_name} *self{parameters}, Fault *fault)"
        return f"{head}\n{{\n    (void)self;\n    (void)fault;\n}}"
    function = program.method(None, None, name)
    if function.returns != NOTHING or len(function.parameters) != parameters.count(","):
        raise FmuError(f"`{program.owner_name}.{name}` must have the parameters of `SlaveBase` and return None")
    return _caller(program, name, parameters, function)


def _caller(program: Program, name: str, parameters: str, function: Function) -> str:
    """Return the function by which the runtime calls a method; what it returns goes into an array."""
    arguments = [a for a in ("self", _ARGUMENTS.get(name), "fault" if function.faults else None) if a]
    call = f"{function.c}({', '.join(arguments)})"
    lines = [] if function.faults else ["(void)fault;"]
    returned = "double" if function.returns == REAL else "void"
    if function.returns in (NOTHING, REAL):
        lines.append(f"return {call};" if function.returns == REAL else f"{call};")
    else:
        parameters = ", double values[]"
        lines += [f"const {program.names.c(function.returns)} found = {call};"]
        lines += ["memcpy(values, found.v, sizeof found.v);"]
    head = f"static {returned} slave_{name}({program.owner_name} *self{parameters}, Fault *fault)"
    return f"{head}\n{{\n" + "".join(f"    {line}\n" for line in lines) + "}"


def _is_defined(program: Program, name: str) -> bool:
    assert program.owner is not None
    return any(name in vars(base) for base in program.owner.cls.__mro__ if base.__module__ not in BASE_MODULES)


def _struct(program: Program, owner: Owner) -> str:
    """Return the type of a slave; lists stand last, because of them only what is in use is saved."""
    fixed = {n: k for n, k in owner.attributes.items() if not isinstance(k, Items)}
    lists = {n: k for n, k in owner.attributes.items() if isinstance(k, Items)}
    fields = [f"    double real[{owner.variables}];", f"    int integer[{owner.variables}];"]
    fields += [f"    {program.names.c(k)} {program.attribute_name(n)};" for n, k in (fixed | lists).items()]
    assert owner.cls.__doc__
    comment = comment_of(owner.cls.__doc__.splitlines()[0])
    name = program.owner_name
    return f"{comment}typedef struct {{\n" + "\n".join(fields) + f"\n}} {name};"


def variable_table(cls: Any) -> str:
    """Return the C table of a slave's variables."""
    rows = []
    for variable in cls.table:
        low, high = variable.bounds
        kind = _TYPES[variable.type]
        numbers = ", ".join(repr(float(number)) for number in (variable.start or 0.0, low, high))
        rows.append(f'    {{"`{variable.name}`", {kind}, {_CAUSALITIES[variable.causality]}, {numbers}}},')
    return "static const Variable variables[] = {\n" + "\n".join(rows) + "\n};"


def _lists(program: Program, owner: Owner) -> str:
    rows = []
    for name, kind in owner.attributes.items():
        if isinstance(kind, Items):
            place = f"{program.owner_name}, {program.attribute_name(name)}"
            sizes = f"sizeof({program.names.c(kind.item)}), {kind.capacity}"
            rows.append(f"    {{offsetof({place}.n), offsetof({place}.v), {sizes}}},")
    return "static const List lists[] = {\n" + "\n".join([*rows, "    {0, 0, 0, 0},"]) + "\n};"


def _settings(cls: Any, owner: Owner, sampled: bool, program: Program) -> str:
    first = next((n for n, k in owner.attributes.items() if isinstance(k, Items)), None)
    name = program.owner_name
    fixed = f"sizeof({name})" if first is None else f"offsetof({name}, {program.attribute_name(first)})"
    lines = [
        f"#define SLAVE {name}",
        f"#define VARIABLES {owner.variables}",
        f"#define FIXED_BYTES {fixed}",
        f"#define FEEDTHROUGH {int(cls.feedthrough)}",
    ]
    return "\n".join(lines + ([f"#define SAMPLE_TIME {cls.sample_time_reference}"] if sampled else []))
