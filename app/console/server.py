"""Serves the console until it is stopped."""

import socket
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from functools import partial
from pathlib import Path
from ssl import SSLError
from types import FrameType

import uvicorn

from steerlab.app.console.app import make_app
from steerlab.app.console.change_feed import ChangeFeed
from steerlab.app.console.config import ConsoleConfig
from steerlab.app.console.connections import Door, LimitedProtocol
from steerlab.app.console.data_export import DataExport
from steerlab.app.console.few_messages import say_few
from steerlab.app.console.priority import give_way
from steerlab.app.console.sign_in import SignIn
from steerlab.app.console.study_thread import StudyCheckJob, StudyThread
from steerlab.app.console.wheel_run import RunView, WheelRuns
from steerlab.sim.errors import InvalidConfig
from steerlab.study.contract import StudyAccess

MOST_WAITING = 128  # connections the system holds until they are taken up


def serve(
    folder: Path,
    open_study: Callable[[], AbstractContextManager[StudyAccess]],
    config: ConsoleConfig,
    *,
    announce: Callable[[str, str], None],
    device: str = "wheel",
    kiosk: bool = False,
) -> RunView | None:
    """Serve a study's pages until Ctrl+C.

    Args:
        folder: the study's, for the wheel phases' own processes.
        open_study: called on each thread that will use the study.
        announce: called with the console's address and each sign-in code; each works once.
        device: at which participants sit, as for ``steerlab study run``.
        kiosk: as of ``make_app``.

    Returns:
        the last run at the wheel; it may still go on.

    Raises:
        InvalidConfig: the address is taken or is not this machine's, or TLS files are unusable.
        SteerlabError: whatever opening the study raises.
    """
    password = config.password()
    listening = _bind(config)
    port = listening.getsockname()[1]
    address = config.address(port)
    try:
        runs = WheelRuns(folder, device=device)  # before ``give_way``
        study_thread = StudyThread(open_study, give_way)
        try:
            check_job = StudyCheckJob(open_study)
            changes = ChangeFeed(study_thread, runs.mark, check_job.mark)
            sign_in = SignIn(announce=partial(announce, address), password=password)
            app = make_app(
                study_thread,
                runs,
                check_job,
                sign_in,
                DataExport(folder),
                origins=config.origins(port),
                address=address,
                changes=changes,
                kiosk=kiosk,
            )
            server = _Server(server_config(app, config, listening), changes)
            say_few()
            sign_in.announce_link()
            give_way()  # not before, which would slow down a browser that ``announce`` opens
            with suppress(KeyboardInterrupt):  # uvicorn raises it again once it has stopped
                server.run(sockets=[listening])
            last = runs.view()
            runs.close()
            return last
        finally:
            study_thread.close()
    finally:
        listening.close()


class _Server(uvicorn.Server):
    """Ends the open pages' streams when it is told to stop, which would otherwise wait for them."""

    def __init__(self, config: uvicorn.Config, changes: ChangeFeed) -> None:
        super().__init__(config)
        self._changes = changes

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self._changes.close()
        super().handle_exit(sig, frame)


def server_config(app: object, config: ConsoleConfig, door: Door) -> uvicorn.Config:
    """How ``app`` is served on connections that come through ``door``.

    Raises:
        InvalidConfig: TLS files are unusable, or others may read the key.
    """
    config.check_tls_key()
    made = uvicorn.Config(
        app,  # pyright: ignore[reportArgumentType] (uvicorn names its own ASGI types)
        access_log=False,  # it would hold the participants' links
        log_level="warning",
        server_header=False,
        proxy_headers=False,  # the address that a header claims must not count
        http=partial(LimitedProtocol, door),  # pyright: ignore[reportArgumentType] (made like it)
        ws="none",
        backlog=MOST_WAITING,
        timeout_keep_alive=60,  # a page that pauses between two answers keeps its connection
        timeout_graceful_shutdown=3,
        ssl_certfile=config.tls_cert,
        ssl_keyfile=config.tls_key,
    )
    try:
        made.load()
    except (OSError, SSLError) as error:
        raise InvalidConfig(
            f"Cannot use {config.tls_cert} and {config.tls_key} for TLS: {error}; "
            "name a PEM certificate and its key."
        ) from error
    return made


def _bind(config: ConsoleConfig) -> Door:
    try:
        addresses = socket.getaddrinfo(
            config.host, config.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        family, kind, protocol, _, where = addresses[0]
        listening = Door(family, kind, protocol)
        try:
            listening.setsockopt(socket.SOL_SOCKET, _address_option(), 1)
            listening.bind(where)
            listening.listen(MOST_WAITING)
        except BaseException:
            listening.close()
            raise
    except OSError as error:
        raise InvalidConfig(
            f"Cannot listen on {config.host} port {config.port}: {error.strerror or error}. "
            "Is another console open? Choose another --port."
        ) from error
    listening.set_inheritable(False)
    return listening


def _address_option() -> int:
    """Allows the address of a console that has just ended; never that of one that runs.

    On Windows ``SO_REUSEADDR`` would let two programs listen at one address.
    """
    return getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
