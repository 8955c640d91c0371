"""Templates: a module that is written once, for the names of a plant, and bound to each plant."""

import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any


def bind(template: Any, plant: Any) -> Any:
    """Return the module ``template`` with the names of a ``plant``'s module for those of its ``SLOTS``.

    ``SLOTS`` is the module beside the template whose ``__all__`` lists the names. Both are modules of this package, be
    it in the project or in an FMU.
    """
    name = f"{template.__name__}[{plant.__package__.rpartition('.')[2]}]"
    if name not in sys.modules:
        spec = spec_from_file_location(name, template.__file__)
        if spec is None or spec.loader is None:
            raise ImportError(name)
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        for slot in import_module(f"{template.__package__}.{template.SLOTS}").__all__:
            setattr(module, slot, getattr(plant, slot))
        sys.modules[name] = module
    return sys.modules[name]
