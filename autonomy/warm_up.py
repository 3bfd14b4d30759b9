"""Compiles numeric kernels ahead of time, so that nobody waits for a compiler in flight.

What a robot's first dive needs comes first; the station compiles the rest while it runs. What only
the reproductions use is compiled when it is first called. A kernel whose machine code is on disk is
only loaded (``autonomy.compiled``), so it does no harm to go through the steps again.
"""

import hashlib
import importlib
import os
import sys
from importlib import metadata
from pathlib import Path

FLIGHT = (
    "autonomy.estimation.model_kernel",
    "autonomy.vehicle.kernel",
    "autonomy.vehicle.water_kernel",
    "autonomy.vehicle.extended_rates",
    "autonomy.vehicle.steep_kernel",
    "autonomy.vehicle.extended_kernel",
    "autonomy.control.kernel",
    "autonomy.control.integral_kernel",
    "autonomy.control.actuator_kernel",
    "autonomy.control.governor_kernel",
    "autonomy.control.swimming_kernel",
    "autonomy.control.law",
    "autonomy.estimation.kernel",
    "autonomy.estimation.tag_filter",
)
"""Steps for the simulated water, and for the estimators and controllers on board; the longest
first."""


def search_step(objective: str) -> str:
    """Return the step that a search by an objective needs."""
    return f"autonomy.planner.search.kernel:{objective}"


LATER = (
    "autonomy.tracking.control.control_kernel",
    "autonomy.tracking.filter.filter_kernel",
    "autonomy.tracking.filter.hypothesis_kernel",
    "autonomy.tracking.filter.cloud_kernel",
    "autonomy.tracking.filter.joint_kernel",
    search_step("information_gain"),
    "autonomy.field.learning.likelihood_kernel",
    "autonomy.whatif.kernel",
    "autonomy.identification.kernel",
    search_step("ergodic"),
    "autonomy.tracking.predictive.kernel",
    "autonomy.tracking.predictive.search",
    search_step("weighted"),
    "simulator.ahead.ensemble",
    "autonomy.vision.pose_kernel",
    "autonomy.vision.sight_kernel",
    "autonomy.vision.corner_kernel",
    "autonomy.vision.lens_kernel",
    "autonomy.vision.refraction_kernel",
    "simulator.camera.trace_kernel",
)
"""Steps for all else: first what a robot needs that follows a target, then the station's work, the
most wanted first. The ensemble flies missions ahead, by the kernels of the flight and its own; what
comes after it is for tanks with cameras."""

OWN_CAMERA = (
    "autonomy.vision.pose_kernel",
    "autonomy.vision.sight_kernel",
    "autonomy.vision.lens_kernel",
    "autonomy.vision.refraction_kernel",
)
"""Those of them that a robot needs that finds itself by its own camera."""
STEPS = (*FLIGHT, *LATER)
"""A step is a module with ``warm_up()``, which calls each of its kernels; what stands behind a
colon is given to it."""


def compile_step(step: str) -> None:
    """Compile what one of ``STEPS`` stands for, or load what is compiled already."""
    module, _, part = step.partition(":")
    importlib.import_module(module).warm_up(*filter(None, (part,)))


def is_complete(*, flight_only: bool = False) -> bool:
    """Tell whether all ``STEPS``, or those of ``FLIGHT``, were compiled from the present sources.

    This looks at the text of every source, which is quick and loads no compiler; what really has to
    be compiled anew is found kernel by kernel.
    """
    digest = source_digest()
    stamps = [_stamp(is_flight) for is_flight in ((False, True) if flight_only else (False,))]
    return any(
        stamp.exists()
        and stamp.read_text() == digest
        and _versions_beside(stamp).exists()
        and _versions_beside(stamp).read_text() == _versions()
        for stamp in stamps
    )


def note_complete(digest: str, *, flight_only: bool = False) -> None:
    """Note that all ``STEPS``, or those of ``FLIGHT``, were compiled from sources of a digest."""
    stamp = _stamp(flight_only)
    stamp.parent.mkdir(parents=True, exist_ok=True)
    _versions_beside(stamp).write_text(_versions())
    stamp.write_text(digest)


def source_digest() -> str:
    """Return a digest of every source of this package."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _versions() -> str:
    libraries = (f"{name} {metadata.version(name)}" for name in ("numba", "llvmlite", "numpy"))
    return "\n".join((sys.version, *libraries))


def _stamp(is_flight: bool) -> Path:
    """Return where it is noted, beside the machine code: where numba was told to keep that.

    An installation that its user cannot write keeps it elsewhere, by ``NUMBA_CACHE_DIR``.
    """
    name = "flight.digest" if is_flight else "compiled.digest"
    folder = os.environ.get("NUMBA_CACHE_DIR")
    return (Path(folder) if folder else Path(__file__).parent / "__pycache__") / name


def _versions_beside(stamp: Path) -> Path:
    return stamp.with_suffix(".versions")
