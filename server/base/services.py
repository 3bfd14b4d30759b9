"""The services of one station, by their types: who installs one adds it, who needs one asks."""

from typing import Any, TypeVar

S = TypeVar("S")


class Services:
    """What the capabilities of one station have made so far.

    A capability asks for what lies below it while it is installed; a route asks for its own
    service by ``server.base.dependency.service``.
    """

    def __init__(self) -> None:
        self._services: dict[type, Any] = {}

    def add(self, service: S, kind: type[S] | None = None) -> S:
        """Keep a service under its own type, or under the protocol that it stands for."""
        self._services[kind or type(service)] = service
        return service

    def get(self, kind: type[S]) -> S:
        """Return the service of a type.

        Raises:
            LookupError: If nobody has installed it.
        """
        try:
            return self._services[kind]
        except KeyError:
            raise LookupError(f"no {kind.__name__} is installed") from None
