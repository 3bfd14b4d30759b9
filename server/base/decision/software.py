"""What decides beside the inputs: the software, its libraries and the processor."""

import hashlib
import importlib.util
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("autonomy", "robot_link", "onboard", "simulator", "server")
"""Whose code a decision may run."""
_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "pydantic")
PROCESSOR = "processor"
"""The one that may differ: whether it matters shows in the outcome."""


@cache
def software() -> dict[str, str]:
    """Return the versions of all that computes decisions, by name; it does not change in a run."""
    return {
        "station": _code_digest(),
        "python": platform.python_version(),
        **{name: _version(name) for name in _LIBRARIES},
        PROCESSOR: _processor(),
    }


def differing(then: dict[str, str], now: dict[str, str]) -> list[str]:
    """Return what of the software is another one now, as words, but for the processor."""
    return [
        f"{name} was {then.get(name, 'not known')} then and is {value} now"
        for name, value in now.items()
        if name != PROCESSOR and then.get(name) != value
    ]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"


def _code_digest() -> str:
    """Return the version of the station with a digest of its code."""
    found = hashlib.sha256()
    for package in _PACKAGES:
        spec = importlib.util.find_spec(package)
        for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
            root = Path(folder)
            for file in sorted(root.rglob("*.py")):
                found.update(f"{package}/{file.relative_to(root).as_posix()}\0".encode())
                found.update(file.read_bytes())
    return f"{_version('grace-ground-station')}+{found.hexdigest()[:12]}"


def _processor() -> str:
    """Return machine and model of the processor, by which numba chooses its instructions."""
    model = platform.processor()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    except OSError:
        pass
    return f"{platform.machine()} {model}".strip()
