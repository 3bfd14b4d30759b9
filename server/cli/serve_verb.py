"""``grace serve``: the station."""

import asyncio
import os
import signal
import socket
import threading
import time
from argparse import SUPPRESS, ArgumentParser, Namespace
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

import autonomy
from db.fault import StoreError
from db.migrate import NewerSchemaError
from server.app import create_app
from server.base.foundation import Foundation
from server.base.settings import Settings
from server.cli.data import settings_of
from server.cli.data_folder import LOG_FOLDER, DataFolderError, hold_data_folder
from server.cli.failure import CommandError
from server.cli.http_server import STREAM_FRAME_MAX, HttpServer, ImpatientHttp
from server.cli.option import add_data_option
from server.cli.service.manager import ServiceManager, keep_alive
from server.system.certificate import CertificateError, ServedCertificate
from server.system.database_wait import WaitingPage, wait_for_database
from server.watch.log import log_station, logged_to_files
from server.watch.memory import return_freed_memory

GRACEFUL_STOP_S = 3
LISTEN_BACKLOG = 128
_PARENT_PERIOD_S = 0.5
_PARENT_GRACE_S = 15.0


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the options of the verb."""
    add_data_option(parser)
    parser.add_argument("--host", help="address to listen on (default: 127.0.0.1)")
    parser.add_argument("--port", type=int, help="port to listen on (default: 8000; 0: a free one)")
    parser.add_argument("--tls-certificate", type=Path, metavar="PEM", help="certificate chain")
    parser.add_argument("--tls-key", type=Path, metavar="PEM", help="key of the certificate")
    parser.add_argument(
        "--behind-proxy", action="store_true", default=None, help="a reverse proxy speaks TLS"
    )
    parser.add_argument(
        "--proxy",
        action="append",
        metavar="NETWORK",
        help="address or network of that proxy (default: this machine); may be given again",
    )
    parser.add_argument(
        "--public-origin",
        action="append",
        metavar="URL",
        help="origin that browsers see, where it differs; may be given again",
    )
    parser.add_argument(
        "--simulation", action="store_true", default=None, help="mark everything SIMULATION"
    )
    parser.add_argument(
        "--clock-file", type=Path, metavar="FILE", help="scaled clock that the simulator shares"
    )
    parser.add_argument(
        "--demo-port",
        type=int,
        metavar="PORT",
        help="loopback port of a simulator with the same option, whose robots may be given faults",
    )
    parser.add_argument(
        "--log-format", choices=("text", "json"), help="lines on the terminal (default: text)"
    )
    parser.add_argument(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        help="from which level on something is logged (default: info)",
    )
    parser.add_argument("--listen-fd", type=int, help=SUPPRESS)
    parser.add_argument("--parent-pid", type=int, help=SUPPRESS)


def run(arguments: Namespace) -> int:
    """Serve until told to stop."""
    settings = settings_of(
        arguments,
        host=arguments.host,
        port=arguments.port,
        tls_certificate=arguments.tls_certificate,
        tls_key=arguments.tls_key,
        behind_proxy=arguments.behind_proxy,
        proxies=arguments.proxy,
        public_origins=arguments.public_origin,
        simulation=arguments.simulation,
        clock_file=arguments.clock_file,
        demo_port=arguments.demo_port,
        log_format=arguments.log_format,
        log_level=arguments.log_level,
    )
    if arguments.parent_pid is not None:
        _end_with_parent(arguments.parent_pid)
    return_freed_memory()
    log_station(settings.log_format, settings.log_level)
    manager = ServiceManager()
    inherited = manager.listener if arguments.listen_fd is None else arguments.listen_fd
    _keep_machine_code(settings.data_dir)
    log_bytes = round(settings.log_limit_mb * 1e6)
    try:
        with (
            hold_data_folder(settings.data_dir),
            logged_to_files(settings.data_dir / LOG_FOLDER, log_bytes),
            _listener(settings, inherited) as at,
        ):
            asyncio.run(_serve(settings, at, manager))
    except (DataFolderError, NewerSchemaError, StoreError, CertificateError, OSError) as error:
        raise CommandError(str(error)) from error
    return 0


def _keep_machine_code(folder: Path) -> None:
    """Keep compiled kernels in the data folder where this user cannot write the installation."""
    if not os.access(Path(autonomy.__file__).parent, os.W_OK):
        os.environ.setdefault("NUMBA_CACHE_DIR", str((folder / "kernels").resolve()))


async def _serve(settings: Settings, listener: socket.socket, manager: ServiceManager) -> None:
    if not await _is_database_there(settings, listener, manager):
        return
    app = create_app(settings)
    async with app.router.lifespan_context(app):
        foundation: Foundation = app.state.foundation
        services = foundation.services
        server = _server(
            app, settings, services.get(ServedCertificate) if settings.has_tls else None
        )
        server.stop_on_signals()
        _reload_on_signal(foundation, manager)
        # Connections wait in the listener's queue from here on, so the address may be told.
        listener.listen(LISTEN_BACKLOG)
        _announce(settings, listener, app.state.first_code)
        manager.ready("Serving")
        foundation.background.start("signs of life", keep_alive(manager, foundation.store))
        await server.serve(sockets=[listener])
        manager.stopping()


async def _is_database_there(
    settings: Settings, listener: socket.socket, manager: ServiceManager
) -> bool:
    """Wait for the database, alive and answering; tell whether to go on."""
    certificate = None
    if settings.tls_certificate is not None and settings.tls_key is not None:
        certificate = ServedCertificate(settings.tls_certificate, settings.tls_key)
    server = _server(WaitingPage(), settings, certificate)
    server.stop_on_signals()

    def waiting() -> None:
        manager.ready("Waiting for the database")
        manager.alive()

    return await wait_for_database(settings.resolved_database_url, server, listener, waiting)


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


def _listener(settings: Settings, inherited: int | None) -> socket.socket:
    if inherited is not None:
        return socket.socket(fileno=inherited)
    listener = socket.socket(socket.AF_INET6 if ":" in settings.host else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((settings.host, settings.port))
    except OSError as error:
        listener.close()
        raise CommandError(
            f"Port {settings.port} of {settings.host} cannot be used ({error.strerror}); "
            "choose another with --port."
        ) from error
    return listener


def _end_with_parent(parent_pid: int) -> None:
    """Stop in order when the parent is gone, however it ended, or by force if that fails."""
    threading.Thread(
        target=_watch_parent, args=(parent_pid,), name="parent watch", daemon=True
    ).start()


def _watch_parent(parent_pid: int) -> None:
    while os.getppid() == parent_pid:
        time.sleep(_PARENT_PERIOD_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_PARENT_GRACE_S)
    os._exit(1)
