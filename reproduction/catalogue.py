"""Every reproduction by its name; its module is imported only when it is asked for."""

import importlib
from collections.abc import Mapping
from types import MappingProxyType, ModuleType

from reproduction.result import Report, Reproduction

REPRODUCTIONS: Mapping[str, str] = MappingProxyType(
    {
        "table-3.1": "tracking errors of three controllers in simulation, two trajectories",
        "table-3.3": "tracking errors of the tank trials, simulated with noise, two trajectories",
        "table-3.3-cameras": "the same with poses by cameras over the tank: table-3.3 --cameras",
        "fig-3.3-cases": "how the pitch wins back horizontal distance, in four cases",
        "fig-3.10": "how slow or late the sliding mass must be for the pitch to oscillate",
        "table-4.1": "following a target by its range, with and without the barrier",
        "table-4.2": "the barrier beside predictive controllers of four objectives",
        "table-4.3": "what a step of each of these controllers costs in time",
        "appendix-c": "orbits under other class-K functions, and under some that are none",
        "experiment-4.5": "the tank experiment: a tail-beating robot follows a virtual target",
        "fig-5.7": "maps of four kinds of adaptive survey, with uncertain positions",
        "fig-5.9": "every field model on the samples of those surveys",
        "claims": "which controller comes closest from 200 random starts, two trajectories",
    }
)
"""Name and what it shows. ``fig-3.3-cases`` is worked out by the module ``fig_3_3_cases``, which
has ``reproduce(seed, report) -> Reproduction``."""


def reproduce(name: str, seed: int, report: Report) -> Reproduction:
    """Work out one reproduction.

    Args:
        name: One of ``REPRODUCTIONS``.
        seed: Decides every random number; the same seed gives the same result.
        report: Told of the progress, from the calling thread.

    Raises:
        KeyError: If there is no such reproduction.
    """
    if name not in REPRODUCTIONS:
        raise KeyError(name)
    return module_of(name).reproduce(seed, report)


def module_of(name: str) -> ModuleType:
    """Return the module that works out a reproduction."""
    return importlib.import_module(f"{__package__}.{name.replace('-', '_').replace('.', '_')}")
