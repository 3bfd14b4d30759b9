"""One POST to a gateway: secrets travel in its body alone, and its answer is bounded."""

import asyncio
from collections.abc import Mapping
from typing import Final
from urllib.parse import urlsplit

import httpx

from robot_link.station.gateway.gateway import GatewayUnreachableError

CONNECT_S: Final = 5.0
TOTAL_S: Final = 15.0
_ANSWER_BYTES_MAX: Final = 64 * 1024


class FormPoster:
    """Posts forms to one URL; belongs to one event loop.

    A redirect is an answer like any other: what is posted may hold a password, which goes to
    no other place than the one that the administrator named.

    Args:
        url: Where to.
        name: What the operator calls the place.
        total_s: Longest time for one POST, connecting included.
    """

    def __init__(self, url: str, name: str, total_s: float = TOTAL_S) -> None:
        self._url = url
        self._name = name
        self._total_s = total_s
        is_near = urlsplit(url).hostname in ("127.0.0.1", "::1", "localhost")
        self._client = httpx.AsyncClient(
            timeout=httpx.Timeout(total_s, connect=min(CONNECT_S, total_s)),
            follow_redirects=False,
            trust_env=not is_near,
        )

    async def post(self, fields: Mapping[str, str]) -> tuple[int, str]:
        """Return status and text of the answer.

        Raises:
            GatewayUnreachableError: If there is none, or one that says that the gateway failed, or
                the URL is none.
        """
        try:
            async with (
                asyncio.timeout(self._total_s),
                self._client.stream("POST", self._url, data=dict(fields)) as answer,
            ):
                text = await _text_of(answer)
        except TimeoutError:
            raise GatewayUnreachableError(
                f"{self._name} did not answer within {self._total_s:.0f} s."
            ) from None
        except (httpx.InvalidURL, UnicodeError):
            raise GatewayUnreachableError(f"The address of {self._name} is none.") from None
        except httpx.HTTPError as error:
            what = type(error).__name__
            raise GatewayUnreachableError(f"{self._name} cannot be reached ({what}).") from None
        if answer.status_code >= 500:
            raise GatewayUnreachableError(
                f"{self._name} failed at this message (HTTP {answer.status_code})."
            )
        return answer.status_code, text

    async def close(self) -> None:
        """Give the connections up."""
        await self._client.aclose()


async def _text_of(answer: httpx.Response) -> str:
    data = b""
    async for piece in answer.aiter_bytes():
        data += piece
        if len(data) > _ANSWER_BYTES_MAX:
            break
    return data[:_ANSWER_BYTES_MAX].decode("utf-8", "replace")
