"""Sign-ins on their way to the provider and back, each good for one return."""

import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from db.query.station.people import PersonRecord
from db.store import Store
from robot_link.clock import monotonic_s
from server.access.oidc.provider import Pending, Provider, ProviderConfig
from server.access.oidc.sign_in import person_of, role_of
from server.access.role import Role
from server.base.problem import Problem, not_found
from server.base.settings import Settings

WAIT_S: Final = 600.0
PENDING_MAX: Final = 1000


@dataclass(frozen=True, slots=True)
class _Begun:
    pending: Pending
    until_s: float


class SignInDesk:
    """The station's side of signing in by a provider. Belongs to one event loop."""

    def __init__(self, settings: Settings) -> None:
        self._provider: Provider | None = None
        self._title = settings.oidc_title
        self._groups_claim = settings.oidc_groups_claim
        self._roles: Mapping[str, Role] = {
            key: Role(role) for key, role in settings.oidc_roles.items()
        }
        self._begun: dict[str, _Begun] = {}
        if settings.oidc_issuer is not None:
            config = ProviderConfig(
                settings.oidc_issuer, settings.oidc_client_id, settings.oidc_secret
            )
            self._provider = Provider(config)

    @property
    def title(self) -> str | None:
        """What stands on the button; ``None`` where there is no provider."""
        return None if self._provider is None else self._title

    async def begin(self, state: str, redirect_uri: str) -> str:
        """Return where a browser is to go.

        Raises:
            Problem: 404 without a provider, 502 if it does not answer.
        """
        now_s = monotonic_s()
        self._begun = {key: one for key, one in self._begun.items() if one.until_s > now_s}
        if len(self._begun) >= PENDING_MAX:
            del self._begun[next(iter(self._begun))]
        pending = Pending(secrets.token_urlsafe(32), secrets.token_urlsafe(48), redirect_uri)
        address = await self._known().address(state, pending)
        self._begun[state] = _Begun(pending, now_s + WAIT_S)
        return address

    async def finish(self, state: str, code: str, store: Store, at: datetime) -> PersonRecord:
        """Return who came back.

        Raises:
            Problem: 401 if it is not proved or came too late, 403 if the settings give them no
                role here, and what ``person_of`` raises.
        """
        begun, provider = self._begun.pop(state, None), self._known()
        if begun is None or begun.until_s <= monotonic_s():
            raise Problem(401, "This sign-in took too long; begin it anew.")
        claims = await provider.claims(code, begun.pending)
        role = role_of(claims, self._roles, self._groups_claim)
        if role is None:
            raise Problem(403, "The provider knows you, but nobody gave you a role here.")
        return await store.write(
            lambda session: person_of(session, provider.issuer, claims, role, at)
        )

    def _known(self) -> Provider:
        if self._provider is None:
            raise not_found("This station has no sign-in provider.")
        return self._provider
