"""Templates: a module that is written once, for the names of a plant, and bound to each plant."""

import ast
import copy
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from .syntax import parse_python


def bind(template: Any, plant: Any) -> Any:
    """Return the module ``template`` with what the module ``plant`` has under the names in its ``SLOTS``.

    Both are modules of this package, be it in the project or in an FMU.
    """
    name = f"{template.__name__}[{plant.__package__.rpartition('.')[2]}]"
    if name not in sys.modules:
        spec = spec_from_file_location(name, template.__file__)
        if spec is None or spec.origin is None:
            raise ImportError(name)
        module = module_from_spec(spec)
        given = {slot: getattr(plant, slot) for slot in template.SLOTS}
        tree = _WrittenOut(given).visit(parse_python(Path(spec.origin).read_bytes()))
        exec(compile(ast.fix_missing_locations(tree), spec.origin, "exec"), vars(module))
        vars(module).update(given)
        sys.modules[name] = module
    return sys.modules[name]


class _WrittenOut(ast.NodeTransformer):
    """``tuple(... for n in range(COUNT))`` item by item, as C compilers do: plain Python takes half as long for it."""

    def __init__(self, given: dict[str, Any]) -> None:
        self._given = given

    def visit_Call(self, node: ast.Call) -> ast.AST:
        made = node.args[0] if node.args else None
        if not isinstance(made, ast.GeneratorExp) or not isinstance(made.generators[0].target, ast.Name):
            return self.generic_visit(node)
        count = self._given[made.generators[0].iter.args[0].id]  # type: ignore[attr-defined]
        variable = made.generators[0].target.id
        return ast.Tuple([_Numbered(variable, n).visit(copy.deepcopy(made.elt)) for n in range(count)], ast.Load())


class _Numbered(ast.NodeTransformer):
    def __init__(self, variable: str, number: int) -> None:
        self._variable, self._number = variable, number

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return ast.Constant(self._number) if node.id == self._variable else node
