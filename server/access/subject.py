"""Which robot a request is about, so that one place can ask for the caller's right on it.

A parameter of a path or of a query (``{plan}``, ``?deployment=``) is resolved to its robots by
what the capability that it belongs to registers in its ``install.py``, one row each. A parameter
that says nothing of robots is registered as such; a test fails for a route with one that nobody
has registered. A route that names its robots in its body is registered too, and asks the guard
itself.
"""

from collections.abc import Awaitable, Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

from fastapi.dependencies.utils import get_flat_params
from fastapi.params import Query
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.requests import HTTPConnection

from db.fault import UnknownIdError
from db.query.fleet.subject import robot_of
from db.store import Store
from server.access.caller import Caller

Resolver: TypeAlias = Callable[[str], Awaitable[Iterable[str]]]
"""Returns the robots that an id belongs to, none for what belongs to the station as a whole.

Raises ``UnknownIdError`` for an id of nothing."""


@dataclass(frozen=True, slots=True)
class Subject:
    """What one parameter of a request names."""

    kind: str
    """What the id is one of, such as ``plan``."""
    identity: str
    robots: frozenset[str]
    """Whose it is; empty for what belongs to the station as a whole."""


async def refuse_unseen(store: Store, caller: Caller, kind: str, identity: str) -> None:
    """Refuse what a body or a query names of another robot, unless the caller may see that one.

    Raises:
        UnknownIdError: There is nothing of this kind and id, or the caller may not see it.
    """
    robot = await store.query(lambda session: robot_of(session, kind, identity))
    if not caller.rights.sees(robot):
        raise UnknownIdError(kind, identity)


async def _itself(robot: str) -> tuple[str, ...]:
    return (robot,)


class Subjects:
    """Knows of each parameter whose robots it names. Belongs to one event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._resolvers: dict[str, tuple[str, Resolver]] = {"robot": ("robot", _itself)}
        self._details: set[str] = set()
        self._self_asking: set[tuple[str, str]] = set()
        self._whole: tuple[str, ...] = ()

    def add(self, parameter: str, resolver: Resolver, kind: str | None = None) -> None:
        """Resolve a parameter, which names things of a kind; by default of its own name."""
        self._resolvers[parameter] = (kind or parameter, resolver)

    def add_stored(self, parameter: str, kind: str | None = None) -> None:
        """Resolve a parameter by the row that it names; see ``db.query.fleet.subject``."""
        named = kind or parameter

        async def robots(identity: str) -> Iterable[str]:
            found = await self._store.query(lambda session: robot_of(session, named, identity))
            return () if found is None else (found,)

        self.add(parameter, robots, named)

    def add_details(self, *parameters: str) -> None:
        """Note parameters that name no robot's things: parts of them, and what all share."""
        self._details.update(parameters)

    def add_self_asking(self, method: str, path: str) -> None:
        """Note a route that names robots in its body, and asks ``Guard.check_robots`` itself."""
        self._self_asking.add((method, path))

    def add_whole(self, *prefixes: str) -> None:
        """Note paths that tell of the whole station: for whoever may see all robots alone."""
        self._whole += prefixes

    def is_whole(self, path: str) -> bool:
        """Tell whether a route tells of the whole station."""
        return path.startswith(self._whole)

    def asks_itself(self, method: str, path: str) -> bool:
        """Tell whether a route asks for the right on its robots itself."""
        return (method, path) in self._self_asking

    def is_known(self, parameter: str) -> bool:
        """Tell whether somebody said what a parameter of a path names."""
        return parameter in self._resolvers or parameter in self._details

    def is_of_a_robot(self, parameter: str) -> bool:
        """Tell whether a parameter names a robot, or something of one."""
        return parameter in self._resolvers

    async def of(self, connection: HTTPConnection) -> list[Subject]:
        """Return what a request names in its path and in its query.

        Raises:
            UnknownIdError: If it names something that there is not.
        """
        return [
            Subject(kind, identity, frozenset(await resolve(identity)))
            for kind, identity, resolve in self._named(connection)
        ]

    def _named(self, connection: HTTPConnection) -> Iterator[tuple[str, str, Resolver]]:
        """Yield kind, id and resolver of each parameter that names a robot's thing.

        Of a query only what the route reads counts: ``?robot=`` at a route that knows none would
        else make a request about the station one about that robot.
        """
        read = _query_names(connection.scope.get("route"))
        query = (each for each in connection.query_params.multi_items() if each[0] in read)
        for name, value in (*connection.path_params.items(), *query):
            if name in self._resolvers:
                kind, resolve = self._resolvers[name]
                yield kind, str(value), resolve


def _query_names(route: object) -> frozenset[str]:
    """Return the parameters of the query that a route reads."""
    if not isinstance(route, APIRoute | APIWebSocketRoute):
        return frozenset()
    fields = get_flat_params(route.dependant)
    return frozenset(one.alias for one in fields if isinstance(one.field_info, Query))
