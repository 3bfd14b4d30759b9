"""Compiles every numeric kernel ahead of time, so that nobody waits for a compiler in flight."""

import hashlib
import importlib
from collections.abc import Iterator
from pathlib import Path

KERNEL_MODULES = (
    "autonomy.vehicle.kernel",
    "autonomy.vehicle.water_kernel",
    "autonomy.vehicle.extended_rates",
    "autonomy.vehicle.steep_kernel",
    "autonomy.vehicle.extended_kernel",
    "autonomy.control.kernel",
    "autonomy.estimation.kernel",
    "autonomy.estimation.model_kernel",
    "autonomy.estimation.rehearsal_kernel",
    "autonomy.control.integral_kernel",
    "autonomy.control.governor_kernel",
    "autonomy.control.swimming_kernel",
    "autonomy.control.law",
    "autonomy.trial.kernel",
    "autonomy.planner.kernel",
    "autonomy.identification.kernel",
    "autonomy.field.likelihood_kernel",
)
"""Modules with compiled functions; each has ``warm_up()``, which calls every one of them."""


def compile_kernels() -> Iterator[tuple[str, int, int]]:
    """Compile module by module, or load what is compiled already.

    Yields:
        Name of the module that is ready, how many are ready, and how many there are.
    """
    for done, name in enumerate(KERNEL_MODULES, start=1):
        importlib.import_module(name).warm_up()
        yield name, done, len(KERNEL_MODULES)


def source_digest() -> str:
    """Return a digest of every source file of this package.

    numba's cache notices a change in a kernel's own file only, not in a kernel that it calls
    from another file; whoever compiles ahead compares this digest and calls ``forget_compiled``.
    """
    digest = hashlib.sha256()
    for path in sorted(_package().rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def forget_compiled() -> None:
    """Delete the machine code that numba keeps beside the sources."""
    for kept in _package().rglob("__pycache__/*.nb[ic]"):
        kept.unlink(missing_ok=True)


def _package() -> Path:
    return Path(__file__).parent
