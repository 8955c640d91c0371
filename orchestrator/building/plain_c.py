"""Plain C of a sampled estimator and controller for a drive: one header, one source, the C library's maths alone.

It is made of the very functions of the native FMUs, with these FMUs' start values as constants, so it gives the same
bits where the compiler does not contract products and sums. There is no heap, no input or output, and no message: what
raises in Python is a status here. All state is static: a program has one loop of each name.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.building.native_sources import RUNTIME, slave_class
from orchestrator.building.sources import Recipe
from orchestrator.building.translation.slave import translate_slave
from pyfmu_sources.adapters.sampled_slave import SampledSlave

ARITHMETIC = "static inline double divided"  # where the arithmetic of the runtime begins, behind its messages
KINDS = re.compile(r"typedef enum \{[^}]*\} FaultKind;")
_COMMENT = re.compile(r"/\*.*?\*/\n?", re.DOTALL)
_FUNCTION = re.compile(r"^static inline \w+ (\w+)\(", re.MULTILINE)
_WORD = re.compile(r"[A-Za-z_]\w*")
_HEADER = """/* {title}
 *
 * Call {name}_start once at the first sample, then {name}_step every {sample_time!r} s. Both return 0, or another
 * number where a value is none: then the outputs are those of the last sample, and the drive must be stopped.
 * Compile {name}.c without contraction of products and sums (-ffp-contract=off) for the bits of the FMUs. */

#ifndef {guard}
#define {guard}

#define {name}_SAMPLE_TIME {sample_time!r}

{structs}

int {name}_start(const {name}_Inputs *inputs, {name}_Outputs *outputs);
int {name}_step(const {name}_Inputs *inputs, {name}_Outputs *outputs);

#endif
"""
_SOURCE = """/* {title}: the source; see {name}.h. */

#include "{name}.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

{kinds}

typedef struct {{
    FaultKind kind;
}} Fault;

#define raise_fault(fault, raised, ...) ((void)((fault)->kind = (fault)->kind ? (fault)->kind : (raised)))

{arithmetic}
{slaves}

{states}

int {name}_start(const {name}_Inputs *inputs, {name}_Outputs *outputs)
{{
    Fault fault = {{NO_FAULT}};
{start}
    return (int)fault.kind;
}}

int {name}_step(const {name}_Inputs *inputs, {name}_Outputs *outputs)
{{
    Fault fault = {{NO_FAULT}};
{step}
    return (int)fault.kind;
}}
"""


@dataclass(frozen=True)
class LoopPart:
    """A slave of the loop: its recipe, and by name of each input where it comes from: "instance.output" or an input."""

    instance: str
    recipe: Recipe
    inputs: Mapping[str, str]


def plain_c(
    name: str,
    title: str,
    parts: Sequence[LoopPart],
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
    sample_time: float,
) -> dict[str, str]:
    """Return the header and the source of sampled slaves, run one after the other: file name to content.

    Args:
        name: prefix of functions and types, and of the files.
        parts: in the order of a sample; an input that comes from a later one is that of the last sample.
        inputs: name -> what it is.
        outputs: name -> "instance.output".
        sample_time: of all slaves [s].
    """
    classes = {part.instance: slave_class(part.recipe) for part in parts}
    structs = (
        _struct(f"{name}_Inputs", inputs),
        _struct(f"{name}_Outputs", {output: _describe_output(classes, source) for output, source in outputs.items()}),
    )
    runtime = (RUNTIME / "translated.h").read_text(encoding="utf-8")
    kinds = KINDS.search(runtime)
    assert kinds is not None
    slaves, states, taken = [], [], frozenset(_WORD.findall(runtime))
    for instance, cls in classes.items():
        translated = translate_slave(cls, taken)
        code = "\n\n".join((translated.types, translated.constants, translated.prototypes, translated.definitions))
        taken |= frozenset(_WORD.findall(code))
        slaves.append(code)
        starts = ", ".join(repr(float(variable.start or 0.0)) for variable in cls.table)
        states.append(f"static {cls.__name__} {instance};")
        states.append(f"static const double {instance}_starts[] = {{{starts}}};")
    shown = [
        f"outputs->{output} = fault.kind ? outputs->{output} : {_value(classes, source)};"
        for output, source in outputs.items()
    ]
    begun = [
        f"memset(&{part.instance}, 0, sizeof {part.instance});\n"
        f"    memcpy({part.instance}.real, {part.instance}_starts, sizeof {part.instance}_starts);"
        for part in parts
    ]
    start = (*begun, *(line for part in parts for line in _run(classes, part, ("take_parameters", "begin"))), *shown)
    step = (*(line for part in parts for line in _run(classes, part, ("predict", "correct"))), *shown)
    said = {"name": name, "title": title}
    header = _HEADER.format(**said, guard=f"{name.upper()}_H", sample_time=sample_time, structs="\n\n".join(structs))
    source = _SOURCE.format(
        **said,
        kinds=kinds[0],
        arithmetic=_arithmetic(runtime, "\n".join(slaves)),
        slaves="\n\n".join(slaves),
        states="\n".join(states),
        start="\n".join(f"    {line}" for line in start),
        step="\n".join(f"    {line}" for line in step),
    )
    return {f"{name}.h": header, f"{name}.c": source}


def _struct(name: str, fields: Mapping[str, str]) -> str:
    lines = "".join(f"    double {field}; /* {said} */\n" for field, said in fields.items())
    return f"typedef struct {{\n{lines}}} {name};"


def _value(classes: Mapping[str, Any], source: str) -> str:
    """Return the C of "instance.variable", or of an input."""
    instance, _, variable = source.rpartition(".")
    return f"{instance}.real[{_place(classes[instance], variable)}]" if instance else f"inputs->{source}"


def _place(cls: Any, variable: str) -> int:
    return [row.name for row in cls.table].index(variable)


def _run(classes: Mapping[str, Any], part: LoopPart, hooks: Sequence[str]) -> list[str]:
    """Return the lines that set the inputs of a part and call its hooks, as far as it has them."""
    cls, instance = classes[part.instance], part.instance
    lines = [f"{instance}.real[{_place(cls, own)}] = {_value(classes, source)};" for own, source in part.inputs.items()]
    had = [hook for hook in hooks if getattr(cls, hook) is not getattr(SampledSlave, hook)]
    return lines + [f"if (!fault.kind)\n        {cls.__name__}_{hook}(&{instance}, &fault);" for hook in had]


def _describe_output(classes: Mapping[str, Any], source: str) -> str:
    instance, _, output = source.rpartition(".")
    variable = next(row for row in classes[instance].table if row.name == output)
    return f"{variable.description} [{variable.unit}]"


def _arithmetic(runtime: str, code: str) -> str:
    """Return the functions of the runtime that code calls, and those that these call."""
    text = _COMMENT.sub("", runtime[runtime.index(ARITHMETIC) : runtime.rindex("#endif")])
    begins = [(found[1], found.start()) for found in _FUNCTION.finditer(text)]
    ends = [start for _, start in begins[1:]] + [len(text)]
    bodies = {name: text[start:end].strip() for (name, start), end in zip(begins, ends, strict=True)}
    needed: set[str] = set()
    fresh = set(_WORD.findall(code)) & set(bodies)
    while fresh:
        needed |= fresh
        fresh = {word for name in fresh for word in _WORD.findall(bodies[name])} & set(bodies) - needed
    return "\n\n".join(body for name, body in bodies.items() if name in needed)
