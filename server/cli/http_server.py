"""The web server as a station runs it: nobody keeps a connection without asking for something."""

import asyncio
import signal
import socket
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, Final

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

HEADER_MAX_S: Final = 10.0
"""From the first byte of a connection, or of a further request on it, to the end of its head."""
CONNECTIONS_MAX: Final = 500
CONNECTIONS_PER_ADDRESS_MAX: Final = 100
"""Of one other machine; a proxy, and all that runs on this one, come from loopback."""
LAST_REQUEST_S: Final = 2.0
"""What a new connection has for its first request when the server stops."""
STREAM_FRAME_MAX: Final = 2**16
"""Bytes of what a browser says on a stream."""


class ImpatientHttp(H11Protocol):
    """Ends connections that do not ask in time, and takes no more than it can keep."""

    _head: asyncio.TimerHandle | None = None
    _is_stream = False
    _is_last = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for a request.

        Answers are written in two pieces. Without the option the second waits until the browser
        has acknowledged the first, which takes it 40 ms; asyncio sets it on some listeners only.
        """
        super().connection_made(transport)
        connection: socket.socket = transport.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._is_one_too_many():
            transport.abort()
            return
        self._await_head()

    def data_received(self, data: bytes) -> None:
        """Take bytes; those of a head that is not whole yet do not prolong its time."""
        super().data_received(data)
        if self._is_stream:
            return
        if self._is_asked():
            self._stop_waiting()
            if self._is_last:
                super().shutdown()  # after its answer
        elif self._head is None:
            self._await_head()

    def on_response_complete(self) -> None:
        """Wait for a further request; between two the server's own time for that holds."""
        super().on_response_complete()
        if self.conn.trailing_data[0]:
            self._await_head()

    def shutdown(self) -> None:
        """Close between two requests; whoever has just connected is answered once."""
        if getattr(self, "cycle", None) is None:
            self._is_last = True
            self._stop_waiting()
            self._head = self.loop.call_later(LAST_REQUEST_S, self._give_up)
        else:
            super().shutdown()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._stop_waiting()
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:  # noqa: ANN401 - h11's own
        """Leave the connection to its stream."""
        self._is_stream = True
        self._stop_waiting()
        super().handle_websocket_upgrade(event)

    def _is_one_too_many(self) -> bool:
        if len(self.connections) > CONNECTIONS_MAX:
            return True
        ours = _address(self)
        if ours in (None, "127.0.0.1", "::1"):
            return False
        return sum(_address(one) == ours for one in self.connections) > CONNECTIONS_PER_ADDRESS_MAX

    def _await_head(self) -> None:
        self._stop_waiting()
        self._head = self.loop.call_later(HEADER_MAX_S, self._give_up)

    def _stop_waiting(self) -> None:
        if self._head is not None:
            self._head.cancel()
            self._head = None

    def _give_up(self) -> None:
        self._head = None
        if not self._is_asked():
            self.transport.abort()

    def _is_asked(self) -> bool:
        cycle: RequestResponseCycle | None = getattr(self, "cycle", None)
        return cycle is not None and not cycle.response_complete


def _address(connection: object) -> str | None:
    client: tuple[str, int] | None = getattr(connection, "client", None)
    return None if client is None else client[0]


_TURNS_TO_CONNECT: Final = 3
"""Turns of the event loop in which a connection that was accepted gets its protocol."""


class HttpServer(uvicorn.Server):
    """Leaves the signals to the caller: the station must be closed after the server, not by it."""

    @contextmanager
    def capture_signals(self) -> Generator[None]:
        """Capture none."""
        yield

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more connections, answer what was asked, and leave no connection open."""
        for server in self.servers:
            server.close()
        for _ in range(_TURNS_TO_CONNECT):
            await asyncio.sleep(0)
        await super().shutdown(sockets)
        for connection in list(self.server_state.connections):
            connection.transport.abort()

    def stop(self) -> None:
        """Stop in order; asked again, stop at once."""
        self.force_exit = self.should_exit
        self.should_exit = True

    def stop_on_signals(self) -> None:
        """Stop on SIGINT and SIGTERM."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.stop)
