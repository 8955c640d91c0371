"""Templates: a module that is written once, for the names of a plant, and bound to each plant."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any


def bind(template: Any, plant: Any) -> Any:
    """Return the module ``template`` with what the module ``plant`` has under the names in its ``SLOTS``.

    Both are modules of this package, be it in the project or in an FMU.
    """
    name = f"{template.__name__}[{plant.__package__.rpartition('.')[2]}]"
    if name not in sys.modules:
        spec = spec_from_file_location(name, template.__file__)
        if spec is None or spec.loader is None:
            raise ImportError(name)
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        for slot in template.SLOTS:
            setattr(module, slot, getattr(plant, slot))
        sys.modules[name] = module
    return sys.modules[name]
