"""The certificate with which the station itself speaks TLS: read anew when it is renewed on disk.

Whoever is connected stays; who connects later gets the new one. A renewal that cannot be used, such
as a certificate whose key has not been written yet, leaves the old one and is told by an alarm.
"""

import asyncio
import logging
import ssl
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from cryptography import x509

from server.base.alarm_board import AlarmBoard

log = logging.getLogger(__name__)

EXPIRY_WARNING: Final = timedelta(days=14)
"""An alarm says that the certificate expires so long before it does."""
LOOK_PERIOD_S: Final = 30.0
_UNUSABLE: Final = "certificate:unusable"
_EXPIRES: Final = "certificate:expires"


class CertificateError(Exception):
    """Certificate and key cannot be used; the sentence says why."""


class ServedCertificate:
    """Certificate and key of a station, and the context in which both are used.

    Belongs to one event loop.

    Raises:
        CertificateError: If they cannot be used.
    """

    def __init__(self, certificate: Path, key: Path) -> None:
        self._certificate = certificate
        self._key = key
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.context.minimum_version = ssl.TLSVersion.TLSv1_2
        self._read = self._marks()
        self.expires = self._use()
        self._is_asked = asyncio.Event()

    def look_now(self) -> None:
        """Read both files anew, changed or not."""
        self._read = ()
        self._is_asked.set()

    async def watch(self, alarms: AlarmBoard) -> None:
        """Take up renewals, and tell of what is wrong, until cancelled."""
        fault = ""
        while True:
            marks = await asyncio.to_thread(self._marks)
            if marks != self._read:
                self._read = marks
                try:
                    self.expires = self._use()
                    fault = ""
                    log.info("the certificate was read; it is valid until %s", self.expires)
                except CertificateError as error:
                    fault = f"The renewed certificate is not used: {error} The old one is."
            await _tell(alarms, _UNUSABLE, fault)
            await _tell(alarms, _EXPIRES, self._sentence())
            self._is_asked.clear()
            try:
                async with asyncio.timeout(LOOK_PERIOD_S):
                    await self._is_asked.wait()
            except TimeoutError:
                pass

    def _use(self) -> datetime:
        """Use what the files hold from now on; return until when it is valid."""
        try:
            expires = x509.load_pem_x509_certificate(
                self._certificate.read_bytes()
            ).not_valid_after_utc
            # Tried on another context: one that refuses the key has taken the certificate already.
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(self._certificate, self._key)
            self.context.load_cert_chain(self._certificate, self._key)
        except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
            raise CertificateError(
                f"{self._certificate} and {self._key} cannot be used ({error})."
            ) from error
        return expires

    def _marks(self) -> tuple[object, ...]:
        """Return what changes when one of the files does; a link that leads elsewhere, too."""
        marks: list[object] = []
        for file in (self._certificate, self._key):
            try:
                found = file.stat()
                marks.append((found.st_dev, found.st_ino, found.st_mtime_ns, found.st_size))
            except OSError as error:
                marks.append(error.errno)
        return tuple(marks)

    def _sentence(self) -> str:
        left = self.expires - datetime.now(UTC)
        if left > EXPIRY_WARNING:
            return ""
        day = f"{self.expires:%Y-%m-%d %H:%M} UTC"
        if left < timedelta():
            return f"The station's certificate expired on {day}; browsers refuse it. Renew it."
        return f"The station's certificate expires on {day}; renew it."


async def _tell(alarms: AlarmBoard, cause: str, sentence: str) -> None:
    if sentence:
        await alarms.raise_(cause, sentence, level="warning")
    else:
        await alarms.clear(cause)
