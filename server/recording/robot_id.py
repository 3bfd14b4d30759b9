"""What a robot may be called."""

from typing import Final

ROBOT_ID: Final = r"^[a-z0-9][a-z0-9-]{0,39}$"
"""Lower-case letters, digits and dashes: it stands in addresses, file names and commands."""
