"""The build backend: setuptools, and the kernels of the shipped plants in machine code beside the package.

It runs where nothing but setuptools is installed. Where the machine has no C compiler it asks for ziglang, for the
build alone. Where nothing compiles, the package is installed without machine code, which is made at its first use.
``pip wheel -C platform=win_amd64`` makes a wheel for another platform, by zig.
"""

import os
import shutil
import sysconfig
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import build_sdist, get_requires_for_build_sdist, prepare_metadata_for_build_wheel

from orchestrator.building.translation.library import HEADERS, library_stem, library_text
from orchestrator.shared.machine_code import HERE, INSTALLED, Platform, library_file, local_compiler, make_library
from orchestrator.shared.scratch import Scratch

__all__ = [
    "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable", "get_requires_for_build_sdist",
    "get_requires_for_build_wheel", "prepare_metadata_for_build_editable", "prepare_metadata_for_build_wheel",
]  # fmt: skip

ZIG = "ziglang==0.17.1"
_PLANTS, _FILTER = "orchestrator.plants.kernels", "orchestrator.estimation.filter"
LIBRARIES = (
    ("orchestrator.paired.loop_kernel", True),
    *((f"{_PLANTS}.{plant}", True) for plant in ("drivetrain", "servo_axis")),
    *((f"{_PLANTS}.motion[{_PLANTS}.{plant}]", False) for plant in ("drivetrain", "servo_axis")),
    ("orchestrator.diagnosis.fmu.loop_kernel", False),
    (f"{_FILTER}.kernel", False),
    (f"{_FILTER}.kernel[{_FILTER}.two_stages]", False),
    ("orchestrator.estimation.online", True),
    ("orchestrator.estimation.flanks.chain", False),
    (f"{_PLANTS}.linear", False),
    (f"{_PLANTS}.requests", False),
)
"""Kernels of the package: modules, and whether their arithmetic is checked; those that compile longest come first."""

# By the name that a wheel has for it. Of an old glibc and an old macOS: a library of these loads in all newer ones.
PLATFORMS = {
    "manylinux_2_17_x86_64": Platform("linux", "x86_64", "x86_64-linux-gnu.2.17"),
    "manylinux_2_17_aarch64": Platform("linux", "aarch64", "aarch64-linux-gnu.2.17"),
    "macosx_11_0_x86_64": Platform("darwin", "x86_64", "x86_64-macos.11.0"),
    "macosx_11_0_arm64": Platform("darwin", "arm64", "aarch64-macos.11.0"),
    "win_amd64": Platform("win32", "AMD64", "x86_64-windows-gnu"),
}

prepare_metadata_for_build_editable = build_meta.prepare_metadata_for_build_editable


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """Return what a wheel needs to be built."""
    chosen = _platform(config_settings)
    return [*build_meta.get_requires_for_build_wheel(config_settings), *([ZIG] if chosen else _compiler())]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    """Return what an editable installation needs to be built."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *_compiler()]


def build_wheel(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    """Build a wheel of this platform, or of any where nothing was compiled; return its name.

    Args:
        config_settings: ``platform``, one of ``PLATFORMS``, makes it for that one.
    """
    name = _platform(config_settings)
    options = {key: value for key, value in (config_settings or {}).items() if key != "platform"}
    with _machine_code_of(PLATFORMS.get(name, HERE)) as count, Scratch("wheel") as scratch:
        if name and count < len(LIBRARIES):
            raise SystemExit(f"zig must compile {len(LIBRARIES)} kernels for {name}, but has made {count}")
        if count:
            name = name or sysconfig.get_platform().replace("-", "_").replace(".", "_")
            options["--build-option"] = [*options.get("--build-option", []), f"--plat-name={name}"]
        # A folder of its own: in the usual one lie the libraries of the last wheel, too.
        options["--global-option"] = [*options.get("--global-option", []), "build", f"--build-base={scratch.path}"]
        return build_meta.build_wheel(wheel_directory, options, metadata_directory)


def build_editable(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    """Build an editable installation, its machine code in the source tree; return the name of its wheel.

    ``editable_mode=compat`` makes a plain path entry of it. Setuptools' own default is an import hook, which type
    checkers and editors do not run, so they would find no types.
    """
    compile_all(INSTALLED)
    options = {"editable_mode": "compat"} | (config_settings or {})
    return build_meta.build_editable(wheel_directory, options, metadata_directory)


def compile_all(folder: Path, made_for: Platform = HERE) -> int:
    """Compile all kernels for a platform into a folder, which is emptied before; return how many were made."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    files = [folder / library_file(library_stem(*entry), made_for) for entry in LIBRARIES]
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # one is compiled while the next is translated
        jobs = [
            pool.submit(make_library, file, library_text(*entry), HEADERS, made_for)
            for file, entry in zip(files, LIBRARIES, strict=True)
        ]
    for job in jobs:
        job.result()
    return sum(file.exists() for file in files)


@contextmanager
def _machine_code_of(made_for: Platform) -> Iterator[int]:
    """Have the kernels of a platform in the tree while a wheel is made of it; yield how many there are."""
    with Scratch("wheel", INSTALLED.parent) as scratch:
        kept = scratch.path / "kept"
        if INSTALLED.exists():
            INSTALLED.rename(kept)
        try:
            yield compile_all(INSTALLED, made_for)
        finally:
            shutil.rmtree(INSTALLED, ignore_errors=True)
            if kept.exists():
                kept.rename(INSTALLED)


def _platform(config_settings: Any) -> str:
    """Return the platform that was asked for; empty for this one."""
    name = (config_settings or {}).get("platform", "")
    if name and name not in PLATFORMS:
        raise SystemExit(f"`platform` must be one of {', '.join(PLATFORMS)}, but is {name!r}")
    return str(name)


def _compiler() -> list[str]:
    return [] if local_compiler() else [ZIG]
