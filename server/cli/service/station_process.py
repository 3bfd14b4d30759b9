"""The process of a station: it serves until it is told to stop, or another has taken over."""

import asyncio
import contextlib
import logging
import signal
import socket
import sys
from functools import partial

import uvicorn
from fastapi import FastAPI
from starlette.types import ASGIApp

from robot_link.clock import monotonic_s
from robot_link.transport.shelf import Shelf
from server.app import create_app
from server.base.foundation import Foundation
from server.base.settings import Settings
from server.cli.http_server import STREAM_FRAME_MAX, HttpServer, ImpatientHttp
from server.cli.service.desk import UpgradeAsked, UpgradeDesk
from server.cli.service.manager import ServiceManager, keep_alive
from server.cli.service.preparation import prepare
from server.cli.service.succession import (
    OPTION,
    Heirloom,
    Predecessor,
    SuccessionError,
    Successor,
)
from server.link.radios import Radios
from server.station import Station
from server.system.certificate import ServedCertificate
from server.system.database_wait import WaitingPage, wait_for_database

log = logging.getLogger(__name__)
GRACEFUL_STOP_S = 3
LISTEN_BACKLOG = 128


class StationProcess:
    """Serves a station, and hands it over when that is asked for.

    Args:
        settings: What it was told from outside.
        manager: Whoever started the process.
        listener: Where browsers connect; the caller closes it.
        lock: Descriptor of the data folder's lock, which the caller closes.
        may_be_replaced: Whether another process may take over; where something else waits for the
            end of this one, it may not.
    """

    def __init__(
        self,
        settings: Settings,
        manager: ServiceManager,
        listener: socket.socket,
        lock: int,
        *,
        may_be_replaced: bool,
    ) -> None:
        self._settings = settings
        self._manager = manager
        self._listener = listener
        self._lock = lock
        self._may_be_replaced = may_be_replaced
        self._let_go_s = 0.0

    async def run(self, heirloom: Heirloom | None) -> None:
        """Serve until told to stop, or until a successor serves.

        Args:
            heirloom: What another process has left to this one, which takes over from it.

        Raises:
            SuccessionError: If this process cannot take over.
        """
        shelf, predecessor = Shelf(), None
        if heirloom is not None:
            shelf = predecessor = Predecessor(heirloom)
            try:
                await prepare(self._settings, predecessor.preparing)
            except SuccessionError as error:
                predecessor.refuse(str(error))
                raise
        elif not await self._is_database_there():
            return
        app = self._app(shelf)
        if predecessor is not None:
            await predecessor.wait()
        while (found := await self._serve(app, predecessor)) is not None:
            if await self._hand_over(shelf, *found):
                return
            app, predecessor = self._app(shelf), None

    def _app(self, shelf: Shelf) -> FastAPI:
        return create_app(self._settings, partial(Station, shelf=shelf))

    async def _serve(
        self, app: FastAPI, predecessor: Predecessor | None
    ) -> tuple[UpgradeAsked, Successor] | None:
        """Serve once; return who asked for a successor and that one, none if told to stop."""
        settings = self._settings
        async with app.router.lifespan_context(app), self._desk() as desk:
            foundation: Foundation = app.state.foundation
            services, background = foundation.services, foundation.background
            server = _server(
                app, settings, services.get(ServedCertificate) if settings.has_tls else None
            )
            server.stop_on_signals()
            _reload_on_signal(foundation, self._manager)
            if predecessor is not None:
                await predecessor.fill()
            # Connections wait in the listener's queue from here on, so the address may be told.
            self._listener.listen(LISTEN_BACKLOG)
            _announce(settings, self._listener, app.state.first_code)
            self._manager.ready("Serving")
            background.start("signs of life", keep_alive(self._manager, foundation.store))
            replacing = background.start("upgrades", self._replace(desk, foundation, server))
            await server.serve(sockets=[self._listener.dup()])
            if not replacing.done() or replacing.exception() is not None:
                self._manager.stopping()
                return None
            asked, successor = replacing.result()
            if server.force_exit:  # told to stop meanwhile
                self._manager.stopping()
                await successor.end()
                return None
            self._manager.reloading("Another process takes over")
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(GRACEFUL_STOP_S):
                    await services.get(Radios).let_go()
        return asked, successor

    def _desk(self) -> contextlib.AbstractAsyncContextManager[UpgradeDesk | None]:
        if self._may_be_replaced:
            return UpgradeDesk(self._settings.data_dir)
        return contextlib.nullcontext()

    async def _replace(
        self, desk: UpgradeDesk | None, foundation: Foundation, server: HttpServer
    ) -> tuple[UpgradeAsked, Successor]:
        """Wait until an upgrade is asked for and its process is prepared; then stop to serve."""
        if desk is None:  # nobody can ask
            return await asyncio.get_running_loop().create_future()
        while True:
            asked = await desk.next()
            asked.tell(f"Starting {asked.python}")
            try:
                successor = await Successor.start(
                    asked.python, _words_of_this_process(), self._listener, self._lock
                )
            except SuccessionError as error:
                await asked.end(f"The station goes on as it was: {error}.", is_done=False)
                continue
            asked.tell("It is prepared; the station hands over")
            self._let_go_s = monotonic_s()
            foundation.changes.close()  # long polls are answered, not cut
            foundation.event_log.close()
            server.stop()
            return asked, successor

    async def _hand_over(self, shelf: Shelf, asked: UpgradeAsked, successor: Successor) -> bool:
        """Hand everything over; tell whether there is nothing left to do for this process.

        Raises:
            SuccessionError: If the new process took over, and ended at once.
        """
        handing = asyncio.ensure_future(successor.take_over(shelf, self._manager))
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, handing.cancel)
        try:
            await handing
        except SuccessionError as error:
            log.warning("the station goes on with this version: %s", error)
            await asked.end(f"The station goes on as it was: {error}.", is_done=False)
            shelf.is_open = False
            return False
        except asyncio.CancelledError:  # told to stop
            await successor.end()
            await asked.end("The station was told to stop.", is_done=False)
            return True
        gap_s = monotonic_s() - self._let_go_s
        await asked.end(f"Taken over; pages waited for {gap_s:.1f} s.", is_done=True)
        if successor.has_ended:
            raise SuccessionError("the new process ended as soon as it had taken over")
        return True

    async def _is_database_there(self) -> bool:
        """Wait for the database, alive and answering; tell whether to go on."""
        settings, certificate = self._settings, None
        if settings.tls_certificate is not None and settings.tls_key is not None:
            certificate = ServedCertificate(settings.tls_certificate, settings.tls_key)
        server = _server(WaitingPage(), settings, certificate)
        server.stop_on_signals()

        def waiting() -> None:
            self._manager.ready("Waiting for the database")
            self._manager.alive()

        return await wait_for_database(
            settings.resolved_database_url, server, self._listener, waiting
        )


def _words_of_this_process() -> list[str]:
    """Return the command line by which this process serves, but what was inherited."""
    words = sys.argv[1:]
    if OPTION in words:
        at = words.index(OPTION)
        words = words[:at] + words[at + 2 :]
    return words


def _reload_on_signal(foundation: Foundation, manager: ServiceManager) -> None:
    """Read the certificate anew on SIGHUP, which stops nothing."""

    def reload() -> None:
        manager.reloading("Reading the certificate")
        if foundation.settings.has_tls:
            foundation.services.get(ServedCertificate).look_now()
        manager.ready("Serving")

    asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, reload)


def _server(app: ASGIApp, settings: Settings, certificate: ServedCertificate | None) -> HttpServer:
    context = None if certificate is None else certificate.context
    return HttpServer(
        uvicorn.Config(
            app,
            lifespan="off",
            log_config=None,
            access_log=False,
            http=ImpatientHttp,
            ws_max_size=STREAM_FRAME_MAX,
            ws_per_message_deflate=False,
            server_header=False,
            timeout_graceful_shutdown=GRACEFUL_STOP_S,
            proxy_headers=settings.behind_proxy,
            forwarded_allow_ips=list(settings.proxies),
            ssl_context_factory=None if context is None else lambda _config, _default: context,
        )
    )


def _announce(settings: Settings, listener: socket.socket, first_code: str | None) -> None:
    scheme = "https" if settings.has_tls else "http"
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    print(f"The station is at {scheme}://{host}:{listener.getsockname()[1]}", flush=True)
    if first_code is not None:
        print(f"Nobody can sign in yet: open it and use the code {first_code}", flush=True)
