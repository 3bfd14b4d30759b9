"""What a request must prove before a route sees it."""

from collections.abc import Awaitable, Callable, Collection
from dataclasses import dataclass
from typing import Final, TypeAlias
from urllib.parse import urlsplit

from fastapi import Request, Response, WebSocket, WebSocketException, status
from fastapi.dependencies.models import Dependant
from starlette.requests import HTTPConnection

from db.actor import Actor, acting
from db.fault import StoreUnavailableError, UnknownIdError
from server.access.access import Access, SignedIn
from server.access.caller import Caller
from server.access.presence import Presence
from server.access.rate import TokenLimits, calls_of
from server.access.read_only import is_open_to_links
from server.access.role import Right, Role
from server.access.secret import secret_hash
from server.access.stream import Tickets
from server.access.subject import Subjects
from server.base.problem import Problem, not_found
from server.base.settings import Settings

CSRF_HEADER: Final = "X-CSRF-Token"
SAFE_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_MARK_S: Final = 180 * 86400
_LOOPBACK_NAMES: Final = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class RobotAsk:
    """A request about robots, by a caller who has the right for each of them."""

    caller: Caller
    right: Right
    robots: frozenset[str]
    """None for what reaches all robots, such as settings without one."""
    connection: HTTPConnection


RobotCheck: TypeAlias = Callable[[RobotAsk], Awaitable[None]]
"""Has the last word on a request that sends robots something; raises ``Problem`` to refuse it.

It may be asked more than once about one request.
"""
ScriptCheck: TypeAlias = Callable[[Caller], None]
"""Has a word on each change by a script; raises ``Problem`` to refuse it."""


class Guard:
    """Checks cookies, bearer tokens, origins, host names and rights for one station."""

    def __init__(
        self,
        access: Access,
        tickets: Tickets,
        settings: Settings,
        subjects: Subjects,
        presence: Presence,
        limits: TokenLimits,
    ) -> None:
        self._access = access
        self._presence = presence
        self._tickets = tickets
        self._settings = settings
        self._subjects = subjects
        self._limits = limits
        self._scraper: Caller | None = None
        """Who read the station's figures last, by a bearer token."""
        self._checks: list[RobotCheck] = []
        self._script_checks: list[ScriptCheck] = []

    def add_check(self, check: RobotCheck) -> None:
        """Ask a check too about each request that sends robots something, after the right."""
        self._checks.append(check)

    def add_script_check(self, check: ScriptCheck) -> None:
        """Ask a check too about each change by a script, but what brings a robot up."""
        self._script_checks.append(check)

    @property
    def speaks_tls(self) -> bool:
        """Whether browsers reach the station by TLS alone."""
        return self._settings.secure_cookie

    def cookie_name(self, connection: HTTPConnection) -> str:
        """Return the session cookie's name; it holds the port, which cookies do not."""
        return f"grace_session_{connection.url.port or 'default'}"

    def set_cookies(self, request: Request, response: Response, signed_in: SignedIn) -> None:
        """Let a browser keep its session's secret, and that it is known, where no script reads."""
        mark = self._access.mark(signed_in.caller.name)
        hours = self._settings.session_hours
        for name, value, path, seconds in (
            (self.cookie_name(request), signed_in.secret, "/", hours * 3600),
            (self._mark_name(request), mark, "/api/session", _MARK_S),
        ):
            response.set_cookie(
                name,
                value,
                max_age=int(seconds),
                path=path,
                httponly=True,
                samesite="lax",
                secure=self._settings.secure_cookie,
            )

    def public_origin(self, request: Request) -> str:
        """Return the origin by which browsers know the station."""
        if self._settings.public_origins:
            return self._settings.public_origins[0]
        scheme = "https" if self._settings.secure_cookie else "http"
        return f"{scheme}://{request.headers.get('host', '')}"

    def state_cookie_name(self, connection: HTTPConnection) -> str:
        """Return the name of what a browser keeps while it is at a sign-in provider."""
        return f"grace_oidc_{connection.url.port or 'default'}"

    def mark_of(self, request: Request) -> str | None:
        """Return what a browser kept of an earlier sign-in."""
        return request.cookies.get(self._mark_name(request))

    def _mark_name(self, connection: HTTPConnection) -> str:
        return f"grace_known_{connection.url.port or 'default'}"

    def host_is_ours(self, connection: HTTPConnection) -> bool:
        """Tell whether the request names a host of this station.

        A loopback station answers to loopback names alone: a foreign site whose name was bent
        to 127.0.0.1 would otherwise pass for the same origin.
        """
        if not self._settings.is_loopback:
            return True
        name = connection.url.hostname
        origins = [*self._settings.public_origins, self._settings.gateway_public_url or ""]
        public = {urlsplit(origin).hostname for origin in origins} - {None}
        return name in _LOOPBACK_NAMES or name in public

    def origin_is_ours(self, connection: HTTPConnection) -> bool:
        """Tell whether the page that asks came from this station, by its scheme too.

        A page that came without TLS, which anybody on the way could write, is none of a station
        that speaks TLS.
        """
        origin = connection.headers.get("origin")
        if origin is None:
            return False
        scheme = "https" if self._settings.secure_cookie else "http"
        ours = f"{scheme}://{connection.headers.get('host', '')}"
        return origin in (*self._settings.public_origins, ours)

    async def caller(
        self, request: Request, right: Right, *, sends: bool = False, changes: bool = False
    ) -> Caller:
        """Return who asks, once it is proved that they may.

        Args:
            request: What is asked.
            right: What it needs.
            sends: Whether it sends robots something, so that ``RobotCheck`` are asked.
            changes: Whether it changes something, so that ``ScriptCheck`` are asked of a script.

        Raises:
            Problem: 401 without a valid cookie or token, 404 for what the caller may not see, 403
                without the right, or when a browser's change lacks the CSRF token or comes from a
                foreign page; 429 where a script asks too much.
        """
        found = await self._bearer(request)
        if found is None:
            found = await self._cookie(request)
            if found is not None and request.method not in SAFE_METHODS:
                self._check_browser(request, found)
        if found is None:
            raise Problem(
                401,
                "Sign in first, or send a bearer token.",
                headers={"WWW-Authenticate": "Bearer"},
            )
        self._limits.admit(found, request, is_at_once=_is_at_once(request))
        before = acting.set(_actor(found))
        try:
            if changes and request.method not in SAFE_METHODS:
                self.check_script(found)
            await self._check(found, right, request, sends=sends)
        except BaseException:
            acting.reset(before)
            raise
        self._presence.note(found, is_change=request.method not in SAFE_METHODS)
        request.state.caller = found
        return found

    async def scraper(self, request: Request) -> Caller:
        """Return who asks for the station's figures, which tell, too, that the database is away.

        Whoever read them last gets them then: nobody revoked that token since.

        Raises:
            Problem: As of ``caller``.
            StoreUnavailableError: The database does not say who this is, and they are another.
        """
        try:
            found = await self.caller(request, Right.VIEW)
        except StoreUnavailableError:
            before, token = self._scraper, _token_of(request)
            if before is None or token is None or self._access.is_over(before):
                raise
            if before.proof.digest != secret_hash(token):
                raise
            return before
        if found.proof.kind == "token":
            self._scraper = found
        return found

    def check_script(self, caller: Caller) -> None:
        """Ask whether a script may change something now.

        Raises:
            Problem: What the checks raise.
        """
        if caller.proof.kind == "token":
            for check in self._script_checks:
                check(caller)

    async def websocket_caller(self, websocket: WebSocket, right: Right = Right.VIEW) -> Caller:
        """Return who opens a WebSocket; call it before ``accept``.

        A one-use ticket may stand in the address as ``?ticket=`` where headers cannot be set.

        Raises:
            WebSocketException: The handshake is refused.
        """
        refused = WebSocketException(status.WS_1008_POLICY_VIOLATION)
        if not self.host_is_ours(websocket):
            raise refused
        found = await self._bearer(websocket)
        ticket = websocket.query_params.get("ticket")
        if found is None and ticket is not None:
            found = await self._tickets.use(ticket)
        if found is None and self.origin_is_ours(websocket):
            found = await self._cookie(websocket)
        if found is None:
            raise refused
        try:
            await self._check(found, right, websocket)
        except Problem as error:
            raise refused from error
        acting.set(_actor(found))
        return found

    async def _check(
        self, caller: Caller, right: Right, connection: HTTPConnection, *, sends: bool = False
    ) -> None:
        """Ask for a right on what a request is about: its robots, or the station as a whole."""
        method, path = connection.scope.get("method", ""), _path_of(connection)
        if caller.is_link and not is_open_to_links(method, path):
            raise Problem(403, "A read-only link does not show this, and changes nothing.")
        has_for_all = caller.rights.may(right)
        if not has_for_all and not caller.rights.by_robot:
            raise _lacking(caller)
        if has_for_all and not sends:
            return
        try:
            subjects = await self._subjects.of(connection)
        except UnknownIdError as error:
            if has_for_all:
                return  # the route says so, after it looked at the rest of the request
            raise not_found(str(error)) from error
        if not subjects and not caller.rights.sees(None) and self._subjects.is_whole(path):
            raise Problem(403, "This tells of all robots; you may see chosen ones.")
        is_of_all = not subjects and not self._subjects.asks_itself(method, path)
        if is_of_all and not has_for_all and right is not Right.VIEW:
            detail = f"{caller.name} may do this with chosen robots, not the whole station."
            raise Problem(403, detail)
        for subject in subjects:
            if not _may(caller, Right.VIEW, subject.robots):
                raise _unknown(subject.kind, subject.identity)
        robots = frozenset[str]().union(*(subject.robots for subject in subjects))
        if subjects or sends:
            is_of_station = any(not subject.robots for subject in subjects)
            await self.check_robots(
                caller, right, robots, connection, also_station=is_of_station, sends=sends
            )

    async def check_robots(
        self,
        caller: Caller,
        right: Right,
        robots: Collection[str],
        connection: HTTPConnection,
        *,
        also_station: bool = False,
        sends: bool = False,
    ) -> None:
        """Ask for a right on robots; for a route that finds them in its body alone.

        Where it ``sends`` them something, ``RobotCheck`` are asked too.

        Raises:
            Problem: 404 if the caller may not see one of them, as if there were none; 403 if they
                may look at it only; and what the checks raise.
        """
        rights = caller.rights
        for robot in sorted(robots):
            if not rights.sees(robot):
                raise _unknown("robot", robot)
            if not rights.may(right, robot):
                role = rights.role_for(robot)
                raise Problem(403, f"{caller.name} is a {role} of {robot} and may not do this.")
        if (also_station or not robots) and not rights.may(right):
            raise _lacking(caller)
        if sends:
            ask = RobotAsk(caller, right, frozenset(robots), connection)
            for check in self._checks:
                await check(ask)

    async def _bearer(self, connection: HTTPConnection) -> Caller | None:
        token = _token_of(connection)
        if token is None:
            return None
        found = await self._access.caller_of_token(token)
        if found is None and connection.scope["type"] == "http":
            raise Problem(
                401,
                "The bearer token is unknown, has expired or was revoked.",
                headers={"WWW-Authenticate": 'Bearer error="invalid_token"'},
            )
        return found

    async def _cookie(self, connection: HTTPConnection) -> Caller | None:
        secret = connection.cookies.get(self.cookie_name(connection))
        return None if secret is None else await self._access.caller_of_cookie(secret)

    def _check_browser(self, request: Request, caller: Caller) -> None:
        if "origin" in request.headers and not self.origin_is_ours(request):
            raise Problem(403, "This change came from a page that is not the station's.")
        if request.headers.get(CSRF_HEADER) != caller.csrf_token:
            raise Problem(
                403, f"A change from a browser needs the header {CSRF_HEADER} (GET /api/session)."
            )


def _token_of(connection: HTTPConnection) -> str | None:
    """Return the bearer token that a request brings, ``None`` if it brings none."""
    scheme, _, token = connection.headers.get("authorization", "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" else None


def _may(caller: Caller, right: Right, robots: Collection[str]) -> bool:
    """Tell whether a caller has a right on each robot, or on the station where there is none."""
    if not robots:
        return caller.rights.may(right)
    return all(caller.rights.may(right, robot) for robot in robots)


def _unknown(kind: str, identity: str) -> Problem:
    """Return what is said of something that the caller may not see: that there is none."""
    return not_found(str(UnknownIdError(kind, identity)))


def _lacking(caller: Caller) -> Problem:
    if caller.role is Role.NONE:
        return Problem(403, f"{caller.name} has no role for the whole station and may not do this.")
    return Problem(403, f"{caller.name} is a {caller.role} and may not do this.")


def _path_of(connection: HTTPConnection) -> str:
    return getattr(connection.scope.get("route"), "path", "")


AT_ONCE: Final = "is_at_once"
"""Marks what a route asks for its caller by, where nothing may keep it from bringing up robots."""


def _is_at_once(request: Request) -> bool:
    dependant = getattr(request.scope.get("route"), "dependant", None)
    if not isinstance(dependant, Dependant):
        return False
    return any(getattr(call, AT_ONCE, False) for call in calls_of(dependant))


def _actor(caller: Caller) -> Actor:
    return Actor(caller.name, "script" if caller.proof.kind == "token" else "person")
