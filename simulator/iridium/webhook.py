"""Posts a gateway's messages to its customer's web server."""

from collections.abc import AsyncGenerator, Mapping
from contextlib import asynccontextmanager
from http import HTTPStatus
from urllib.parse import urlsplit

import httpx

from simulator.iridium.loopback import check_loopback

_PORTS = 65536


class Webhook:
    """One URL that takes messages.

    Args:
        url: Where messages go; None as long as the customer has no web server.
        timeout_s: How long the customer may take to answer, by the wall's clock.

    Raises:
        ValueError: If the URL is not of this machine.
    """

    def __init__(self, url: str | None, timeout_s: float) -> None:
        self._url = url
        self._timeout_s = timeout_s
        self._client: httpx.AsyncClient | None = None
        self.point_to(url)

    def point_to(self, url: str | None) -> None:
        """Post to another URL from now on.

        Raises:
            ValueError: If it is none, or not of this machine.
        """
        if url is not None:
            check_loopback(urlsplit(url).hostname)
            try:
                parts = httpx.URL(url)
            except httpx.InvalidURL as error:
                raise ValueError(f"{url}: {error}") from error
            if parts.scheme not in ("http", "https") or not 0 < (parts.port or 80) < _PORTS:
                raise ValueError(f"{url}: messages are posted to http://host:port/path")
        self._url = url

    @asynccontextmanager
    async def opened(self) -> AsyncGenerator[None]:
        """Be able to post as long as the context lasts."""
        # The customer is this machine: neither its proxy nor its certificate matters.
        async with httpx.AsyncClient(
            timeout=self._timeout_s, trust_env=False, verify=False
        ) as client:
            self._client = client
            try:
                yield
            finally:
                self._client = None

    async def post(self, values: Mapping[str, object], *, as_json: bool) -> bool:
        """Return whether the customer took a message."""
        if self._client is None or self._url is None:
            return False
        try:
            if as_json:
                response = await self._client.post(self._url, json=values)
            else:
                response = await self._client.post(self._url, data=values)
        except httpx.HTTPError:
            return False
        return response.status_code == HTTPStatus.OK
