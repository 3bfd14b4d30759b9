"""Roles and the rights that they carry."""

from enum import StrEnum


class Right(StrEnum):
    """What a person may do; the operator app shows or hides buttons by it."""

    VIEW = "view"
    PILOT = "pilot"
    """Plan, upload, command, configure, import, acknowledge."""
    ADMINISTER = "administer"
    """People, tokens, robots and their links."""


class Role(StrEnum):
    """What a person or a script is to the station; each role has the rights of those before."""

    VIEWER = "viewer"
    PILOT = "pilot"
    ADMIN = "admin"

    @property
    def rights(self) -> tuple[Right, ...]:
        """Rights of the role."""
        match self:
            case Role.VIEWER:
                return (Right.VIEW,)
            case Role.PILOT:
                return (Right.VIEW, Right.PILOT)
            case Role.ADMIN:
                return (Right.VIEW, Right.PILOT, Right.ADMINISTER)
