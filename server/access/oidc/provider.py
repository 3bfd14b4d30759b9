"""One provider of OpenID Connect: where it is, and what it says of who signed in."""

import base64
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import urlencode

import httpx

from server.base.problem import Problem

PATIENCE_S: Final = 8.0
"""For each answer of the provider; a slow one must not hold a sign-in up for ever."""
_ALGORITHMS: Final = ["RS256", "PS256", "ES256", "EdDSA"]
_SCOPE: Final = "openid profile email"
_LEEWAY_S: Final = 60


@dataclass(frozen=True, slots=True)
class ProviderConfig:
    """What the station was told of its provider."""

    issuer: str
    client_id: str
    client_secret: str | None
    """``None`` of a public client, which PKCE alone protects."""


@dataclass(frozen=True, slots=True)
class Pending:
    """A sign-in on its way to the provider and back."""

    nonce: str
    verifier: str
    redirect_uri: str


class Provider:
    """Asks one provider. Belongs to one event loop."""

    def __init__(self, config: ProviderConfig) -> None:
        self._config = config
        self._document: Mapping[str, Any] | None = None

    @property
    def issuer(self) -> str:
        """Who vouches."""
        return self._config.issuer

    async def address(self, state: str, pending: Pending) -> str:
        """Return where a browser is to go.

        Raises:
            Problem: 502 if the provider does not answer, or not as one.
        """
        document = await self._discovered()
        challenge = hashlib.sha256(pending.verifier.encode()).digest()
        query = {
            "response_type": "code",
            "client_id": self._config.client_id,
            "redirect_uri": pending.redirect_uri,
            "scope": _SCOPE,
            "state": state,
            "nonce": pending.nonce,
            "code_challenge": base64.urlsafe_b64encode(challenge).rstrip(b"=").decode(),
            "code_challenge_method": "S256",
        }
        start = _text(document, "authorization_endpoint")
        return f"{start}{'&' if '?' in start else '?'}{urlencode(query)}"

    async def claims(self, code: str, pending: Pending) -> Mapping[str, Any]:
        """Return what the provider vouches for, once its signature and our nonce are proved.

        Raises:
            Problem: 502 if the provider does not answer, 401 if what it says proves nothing.
        """
        document = await self._discovered()
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": pending.redirect_uri,
            "client_id": self._config.client_id,
            "code_verifier": pending.verifier,
        }
        secret = self._config.client_secret
        auth = None if secret is None else httpx.BasicAuth(self._config.client_id, secret)
        if auth is not None:
            del form["client_id"]
        endpoint = _text(document, "token_endpoint")
        answer = await self._ask("POST", endpoint, data=form, auth=auth)
        keys = await self._ask("GET", _text(document, "jwks_uri"))
        proved = self._proved(_text(answer, "id_token"), keys, pending)
        return {**await self._told(document, answer, proved["sub"]), **proved}

    async def _told(
        self, document: Mapping[str, Any], answer: Mapping[str, Any], subject: str
    ) -> Mapping[str, Any]:
        """Return what the provider tells beside its signed token, of the same subject alone."""
        if "userinfo_endpoint" not in document:
            return {}
        bearer = {"Authorization": f"Bearer {_text(answer, 'access_token')}"}
        told = await self._ask("GET", _text(document, "userinfo_endpoint"), headers=bearer)
        if told.get("sub") != subject:
            raise Problem(401, "The provider speaks of somebody else; try again.")
        return told

    def _proved(
        self, id_token: str, keys: Mapping[str, Any], pending: Pending
    ) -> Mapping[str, Any]:
        from joserfc import jwt  # here: most stations have no provider
        from joserfc.errors import JoseError
        from joserfc.jwk import KeySet

        try:
            known = KeySet.import_key_set({"keys": keys["keys"]})
            token = jwt.decode(id_token, known, algorithms=_ALGORITHMS)
            jwt.JWTClaimsRegistry(
                leeway=_LEEWAY_S,
                iss={"essential": True, "value": self._config.issuer},
                aud={"essential": True, "value": self._config.client_id},
                exp={"essential": True},
                sub={"essential": True},
                nonce={"essential": True, "value": pending.nonce},
            ).validate(token.claims)
        except (JoseError, ValueError, KeyError, TypeError) as error:
            raise Problem(401, "What the provider says of you is not proved; try again.") from error
        return token.claims

    async def _discovered(self) -> Mapping[str, Any]:
        """Return the provider's document of itself; a failure is asked anew next time."""
        if self._document is None:
            address = f"{self._config.issuer.rstrip('/')}/.well-known/openid-configuration"
            document = await self._ask("GET", address)
            if document.get("issuer") != self._config.issuer:
                raise Problem(502, f"The provider calls itself {document.get('issuer')!r}.")
            self._document = document
        return self._document

    async def _ask(
        self,
        method: str,
        address: str,
        data: Mapping[str, str] | None = None,
        auth: httpx.BasicAuth | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> Mapping[str, Any]:
        try:
            async with httpx.AsyncClient(timeout=PATIENCE_S) as client:
                answer = await client.request(
                    method, address, data=data, auth=auth, headers=headers
                )
            content = answer.json()
        except (httpx.HTTPError, httpx.InvalidURL, ValueError) as error:
            raise Problem(
                502, "The sign-in provider does not answer; use your password, or try again."
            ) from error
        if answer.is_error or not isinstance(content, dict):
            raise Problem(502, "The sign-in provider refused; use your password, or try again.")
        return content


def _text(document: Mapping[str, Any], field: str) -> str:
    value = document.get(field)
    if not isinstance(value, str) or not value:
        raise Problem(502, f"The sign-in provider says no {field}; use your password.")
    return value
