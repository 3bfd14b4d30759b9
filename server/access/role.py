"""Roles and the rights that they carry, for all robots and for chosen ones."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Final


class Right(StrEnum):
    """What a person may do; the operator app shows or hides buttons by it."""

    VIEW = "view"
    PILOT = "pilot"
    """Plan, upload, command, configure, import, acknowledge."""
    ADMINISTER = "administer"
    """People, tokens, robots and their links."""


class Role(StrEnum):
    """What a person or a script is to the station; each role has the rights of those before."""

    NONE = "none"
    """Nothing of the station as a whole; chosen robots alone, if any."""
    VIEWER = "viewer"
    PILOT = "pilot"
    ADMIN = "admin"

    @property
    def rights(self) -> tuple[Right, ...]:
        """Rights of the role."""
        match self:
            case Role.NONE:
                return ()
            case Role.VIEWER:
                return (Right.VIEW,)
            case Role.PILOT:
                return (Right.VIEW, Right.PILOT)
            case Role.ADMIN:
                return (Right.VIEW, Right.PILOT, Right.ADMINISTER)


_ORDER: Final = tuple(Role)


def higher(one: Role, other: Role) -> Role:
    """Return which of two roles lets somebody do more."""
    return max(one, other, key=_ORDER.index)


@dataclass(frozen=True, slots=True)
class Rights:
    """What somebody may do: a role for the station and all robots, and more for chosen robots."""

    for_all: Role
    by_robot: Mapping[str, Role] = field(default_factory=lambda: MappingProxyType({}))
    """Roles of chosen robots, by grant or by group; the higher of both roles holds."""

    @classmethod
    def of(cls, for_all: str, roles: Iterable[tuple[str, str]]) -> "Rights":
        """Put rights together from a role, and from robots with a role for each grant of them."""
        by_robot: dict[str, Role] = {}
        for robot, role in roles:
            by_robot[robot] = higher(by_robot.get(robot, Role.NONE), Role(role))
        return cls(Role(for_all), MappingProxyType(by_robot))

    def role_for(self, robot: str) -> Role:
        """Return the role for one robot."""
        return higher(self.for_all, self.by_robot.get(robot, Role.NONE))

    def may(self, right: Right, robot: str | None = None) -> bool:
        """Tell whether something is allowed with a robot; with the whole station, without one."""
        role = self.for_all if robot is None else self.role_for(robot)
        return right in role.rights

    def may_any(self, right: Right) -> bool:
        """Tell whether something is allowed with the whole station, or with some robot at all."""
        return any(right in role.rights for role in (self.for_all, *self.by_robot.values()))

    def sees(self, robot: str | None) -> bool:
        """Tell whether what belongs to a robot may be seen; of the station, without one."""
        return self.may(Right.VIEW, robot)

    @property
    def robots(self) -> frozenset[str] | None:
        """The robots that may be seen; ``None`` for all, and those to come."""
        if self.sees(None):
            return None
        return frozenset(
            robot for robot, role in self.by_robot.items() if Right.VIEW in role.rights
        )
