"""What holds for every test: one thread for algebra, no hurry for a property's examples.

A run may be told when its last test begins: a machine that has an hour for all walks says so, and
the walks that did not begin are named as skipped.
"""

import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in the product, before numpy is imported

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")

_BEGAN_S = time.monotonic()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--begin-within",
        type=float,
        metavar="MINUTES",
        help="skip the tests that would begin later than so many minutes after the run",
    )


def pytest_runtest_setup(item: pytest.Item) -> None:
    minutes = item.config.getoption("--begin-within")
    if minutes is not None and time.monotonic() - _BEGAN_S > 60.0 * minutes:
        pytest.skip(f"it would have begun more than {minutes:g} minutes after the run began")
