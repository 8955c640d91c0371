"""The plants that are known: one module each, which holds its ``PLANT``."""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from orchestrator.plants.description import Plant


@cache
def plants() -> Mapping[str, Plant]:
    """Return every known plant by the name of its FMU."""
    modules = (importlib.import_module(f"{__name__}.{entry.name}") for entry in pkgutil.iter_modules(__path__))
    found: list[Plant] = [module.PLANT for module in modules]
    return {plant.name: plant for plant in found}
