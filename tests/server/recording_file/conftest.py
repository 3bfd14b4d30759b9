"""Readers need no station."""

import pytest


@pytest.fixture
def _known_fleet():
    """No database is made."""
