"""Compiles every numeric kernel ahead of time, so that nobody waits for a compiler in flight."""

import hashlib
import importlib
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
    "reproduction.estimation.trial_flight_kernel",
    "autonomy.control.integral_kernel",
    "autonomy.control.governor_kernel",
    "autonomy.control.swimming_kernel",
    "autonomy.control.law",
    "autonomy.whatif.kernel",
    "autonomy.planner.search.kernel",
    "autonomy.identification.kernel",
    "autonomy.field.learning.likelihood_kernel",
    "autonomy.tracking.control.control_kernel",
    "autonomy.tracking.filter.filter_kernel",
    "autonomy.tracking.filter.hypothesis_kernel",
    "autonomy.tracking.filter.cloud_kernel",
    "reproduction.tracking.target_path_kernel",
    "reproduction.tracking.unicycle",
    "reproduction.tracking.run_kernel",
    "autonomy.tracking.predictive.kernel",
    "autonomy.tracking.predictive.search",
)
"""Modules with compiled functions; each has ``warm_up()``, which calls every one of them."""


LONGEST = "autonomy.planner.search.kernel"
"""The module that takes about as long as all others; it calls no kernel of another package."""


def compile_module(name: str) -> None:
    """Compile one of ``KERNEL_MODULES``, or load what is compiled already."""
    importlib.import_module(name).warm_up()


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
