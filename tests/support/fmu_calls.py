"""Raw FMI 2.0 calls through ctypes, for the tests: every status and every message is seen."""

import ctypes
import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from orchestrator.fmi.libraries import ends_cleanly

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
_LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class _Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", _LOGGER),
        *((name, ctypes.c_void_p) for name in ("allocate", "free", "finished", "environment")),
    ]


class RawFmu:
    """An extracted FMU and its library."""

    def __init__(self, path: Path) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="fmu "))
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        with zipfile.ZipFile(path) as archive:
            archive.extractall(self.folder)
        root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        self.name = root.attrib["modelName"]
        self.guid = root.attrib["guid"]
        self.references = {v.attrib["name"]: int(v.attrib["valueReference"]) for v in root.iter("ScalarVariable")}
        self.library = ctypes.CDLL(str(self.folder / "binaries" / "linux64" / f"{self.name}.so"))
        self.messages: list[tuple[int, str]] = []
        self._callbacks = _Callbacks(_LOGGER(self._log), None, None, None, None)
        self.library.fmi2Instantiate.restype = ctypes.c_void_p

    def _log(self, _environment: Any, _instance: bytes, status: int, _category: bytes, message: bytes) -> None:
        self.messages.append((status, message.decode()))

    def instantiate(self, guid: str | None = None, resources: str | None = None) -> ctypes.c_void_p | None:
        """Return the component, or None."""
        uri = (self.folder / "resources").as_uri() if resources is None else resources
        component = self.library.fmi2Instantiate(
            b"instance", 1, (guid or self.guid).encode(), uri.encode(), ctypes.byref(self._callbacks), 0, 0
        )
        ends_cleanly(self.folder / "binaries" / "linux64")  # or this process aborts now and then as it ends
        return None if component is None else ctypes.c_void_p(component)

    def started(self, **reals: float) -> ctypes.c_void_p:
        """Return a component in step mode."""
        component = self.instantiate()
        assert component is not None
        for name, value in reals.items():
            assert self.set_real(component, [name], [value]) == OK
        assert self.setup(component) == OK
        assert self.library.fmi2EnterInitializationMode(component) == OK
        assert self.library.fmi2ExitInitializationMode(component) == OK
        return component

    def setup(self, component: ctypes.c_void_p) -> int:
        """Call fmi2SetupExperiment without stop time."""
        zero = ctypes.c_double(0.0)
        return int(self.library.fmi2SetupExperiment(component, 0, zero, zero, 0, zero))

    def step(self, component: ctypes.c_void_p, time: float, step: float) -> int:
        """Call fmi2DoStep."""
        return int(self.library.fmi2DoStep(component, ctypes.c_double(time), ctypes.c_double(step), 1))

    def set_real(self, component: ctypes.c_void_p, names: Sequence[str | int], values: Sequence[float]) -> int:
        """Call fmi2SetReal."""
        n = len(names)
        return int(
            self.library.fmi2SetReal(component, self._vrs(names), ctypes.c_size_t(n), (ctypes.c_double * n)(*values))
        )

    def get_real(self, component: ctypes.c_void_p, names: Sequence[str | int]) -> tuple[int, list[float]]:
        """Call fmi2GetReal."""
        n = len(names)
        values = (ctypes.c_double * n)()
        status = self.library.fmi2GetReal(component, self._vrs(names), ctypes.c_size_t(n), values)
        return int(status), list(values)

    def _vrs(self, names: Sequence[str | int]) -> Any:
        references = [name if isinstance(name, int) else self.references[name] for name in names]
        return (ctypes.c_uint * len(references))(*references)
