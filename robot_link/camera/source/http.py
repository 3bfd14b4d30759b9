"""A camera that is asked by HTTP: a stream of JPEGs, or single ones asked for again and again.

Redirects are not followed, proxies of the environment not used, and certificates are verified
against the authorities that this machine trusts.
"""

import ssl
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import Final

import httpx

from robot_link.camera.sighting import SourceSettings
from robot_link.camera.source.frame import TIMEOUT_S, Frames, SourceError, arrived
from robot_link.camera.source.multipart import MultipartReader, boundary_of
from robot_link.camera.uri import HttpUri
from robot_link.camera.wire import BODY_MAX

_HEADERS: Final = {"accept": "multipart/x-mixed-replace, image/jpeg", "accept-encoding": "identity"}
_OK, _UNAUTHORIZED = 200, 401


def http_frames(uri: HttpUri, settings: SourceSettings) -> Frames:
    """Return the pictures of a camera as they come."""
    latency_s = uri.latency_s if settings.latency_s is None else settings.latency_s
    with _client() as client:
        auth: httpx.Auth | None = None
        while True:
            begun = time.monotonic()
            with _answer(client, uri.url, auth) as response:
                if response.status_code == _UNAUTHORIZED and auth is None and settings.password:
                    auth = _auth(response, settings)
                    continue
                _check(response)
                content_type = response.headers.get("content-type", "")
                is_stream = content_type.lower().startswith("multipart/")
                for picture in _parts(response, content_type) if is_stream else _one(response):
                    yield arrived(picture, latency_s)
            if is_stream:
                raise SourceError("the camera ended its stream")
            time.sleep(max(0.0, 1.0 / uri.fps - (time.monotonic() - begun)))


def _client() -> httpx.Client:
    return httpx.Client(
        verify=ssl.create_default_context(),
        trust_env=False,
        follow_redirects=False,
        timeout=TIMEOUT_S,
        headers=_HEADERS,
    )


@contextmanager
def _answer(client: httpx.Client, url: str, auth: httpx.Auth | None) -> Generator[httpx.Response]:
    try:
        with client.stream("GET", url, auth=auth) as response:
            yield response
    except httpx.TimeoutException:
        raise SourceError(f"the camera says nothing for {TIMEOUT_S:g} s") from None
    except httpx.ConnectError as error:
        is_untrusted = "CERTIFICATE" in str(error).upper()
        why = "its certificate is not trusted" if is_untrusted else "nobody answers there"
        raise SourceError(f"the camera cannot be reached: {why} ({error})") from None
    except (httpx.HTTPError, httpx.InvalidURL, ValueError) as error:
        raise SourceError(f"the camera breaks off: {error or type(error).__name__}") from None


def _auth(response: httpx.Response, settings: SourceSettings) -> httpx.Auth:
    """Return how the camera wants to be told who asks."""
    challenge = response.headers.get("www-authenticate", "").lower()
    kind = httpx.DigestAuth if challenge.startswith("digest") else httpx.BasicAuth
    return kind(settings.user, settings.password)


def _check(response: httpx.Response) -> None:
    """Make sure that the camera answers with what was asked for.

    Raises:
        SourceError: If it does not.
    """
    status = response.status_code
    if status == _UNAUTHORIZED:
        raise SourceError("the camera wants a user and a password, or others than these")
    if response.has_redirect_location:
        raise SourceError("the camera sends elsewhere, which is not followed: write where it is")
    if status != _OK:
        raise SourceError(f"the camera answers {status} {response.reason_phrase}".rstrip())


def _parts(response: httpx.Response, content_type: str) -> Iterator[bytes]:
    reader = MultipartReader(boundary_of(content_type))
    for data in response.iter_raw():
        yield from reader.take(data)


def _one(response: httpx.Response) -> Iterator[bytes]:
    content_type = response.headers.get("content-type", "").partition(";")[0].strip().lower()
    if content_type and not content_type.startswith(("image/", "application/octet-stream")):
        raise SourceError(f"the camera answers with {content_type[:60]}, which is no picture")
    picture = bytearray()
    for data in response.iter_raw():
        picture += data
        if len(picture) > BODY_MAX:
            raise SourceError(f"a picture is longer than {BODY_MAX} bytes")
    yield bytes(picture)
