"""The build backend: setuptools, and the kernels of the shipped plants in machine code beside the package.

It runs where nothing but setuptools is installed. Where the machine has no C compiler it asks for ziglang, for the
build alone. Where nothing compiles, the package is installed without machine code, which is made at its first use.
"""

import os
import shutil
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import build_sdist, get_requires_for_build_sdist, prepare_metadata_for_build_wheel

from orchestrator.building.translation.library import HEADERS, library_stem, library_text
from orchestrator.shared.machine_code import INSTALLED, library_file, local_compiler, make_library

__all__ = [
    "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable", "get_requires_for_build_sdist",
    "get_requires_for_build_wheel", "prepare_metadata_for_build_editable", "prepare_metadata_for_build_wheel",
]  # fmt: skip

ZIG = "ziglang==0.17.1"
_PLANTS = "orchestrator.plants.kernels"
LIBRARIES = (
    *((f"{_PLANTS}.motion[{_PLANTS}.{plant}]", False) for plant in ("drivetrain", "servo_axis")),
    *((f"{_PLANTS}.motion[{_PLANTS}.learned[{_PLANTS}.{plant}]]", False) for plant in ("drivetrain", "servo_axis")),
    *((f"{_PLANTS}.{plant}", True) for plant in ("drivetrain", "servo_axis")),
    (f"{_PLANTS}.linear", False),
    (f"{_PLANTS}.requests", False),
    ("orchestrator.estimation.kernel", False),
    ("orchestrator.estimation.stages.kernel", False),
    ("orchestrator.estimation.flanks.chain", False),
    ("orchestrator.estimation.online", True),
    ("orchestrator.diagnosis.fmu.loop_kernel", False),
    ("orchestrator.paired.loop_kernel", True),
)
"""Kernels of the package: modules, and whether their arithmetic is checked."""

prepare_metadata_for_build_editable = build_meta.prepare_metadata_for_build_editable


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """Return what a wheel needs to be built."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_compiler()]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    """Return what an editable installation needs to be built."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *_compiler()]


def build_wheel(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    """Build a wheel of this platform, or of any where nothing was compiled; return its name.

    Args:
        wheel_directory: folder in which the wheel is put.
    """
    compile_all(INSTALLED)
    options = dict(config_settings or {})
    if any(INSTALLED.glob("*.so")):
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        options["--build-option"] = [*options.get("--build-option", []), f"--plat-name={platform}"]
    return build_meta.build_wheel(wheel_directory, options, metadata_directory)


def build_editable(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    """Build an editable installation, its machine code in the source tree; return the name of its wheel.

    Args:
        wheel_directory: folder in which the wheel is put.
    """
    compile_all(INSTALLED)
    return build_meta.build_editable(wheel_directory, config_settings, metadata_directory)


def compile_all(folder: Path) -> None:
    """Compile all kernels of the package into a folder, which is emptied before.

    Args:
        folder: of the libraries, made anew.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    texts = {library_stem(*entry): library_text(*entry) for entry in LIBRARIES}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in pool.map(lambda item: make_library(folder / library_file(item[0]), item[1], HEADERS), texts.items()):
            pass


def _compiler() -> list[str]:
    return [] if local_compiler() else [ZIG]
