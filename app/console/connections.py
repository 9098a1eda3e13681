"""Connections: few from each client, and none that keeps the console waiting for long."""

import asyncio
import errno
import logging
import os
import socket
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from time import monotonic, sleep
from typing import Any, cast

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from steerlab.app.console.sign_in import source_of

HEADERS_S = 10.0  # from the connection, or a request's first byte, to the end of its headers
BODY_S = 20.0  # from there to the end of its body
ANSWER_S = 30.0  # for taking up an answer that does not fit into the system's buffers
MOST_OF_ONE = 100  # connections of a client; a browser opens six to a console
MOST_IN_ALL = 400
KEPT_FREE = 150  # file handles for everything else: the database, runs, static files
FEWEST_IN_ALL = 16
MOST_TURNED_AWAY = 100  # at a time; then whoever is connected has a turn
MOST_LEAVING = 16  # connections that were ended and still hold a file handle
SAY_EVERY_S = 60.0

_LOG = logging.getLogger(__name__)


@dataclass(eq=False, slots=True)
class _Guest:
    """A connection that was taken up; without a protocol until TLS is agreed on."""

    connection: socket.socket
    source: str
    protocol: "LimitedProtocol | None" = None
    turned_out: bool = False

    @property
    def is_open(self) -> bool:
        return self.connection.fileno() != -1

    @property
    def is_waited_for(self) -> bool:
        """Whether no request of it is being answered."""
        return self.protocol is None or self.protocol.is_waited_for

    def turn_out(self) -> None:
        """End the connection; asyncio sees its end and closes it."""
        self.turned_out = True
        with suppress(OSError):  # it has ended by itself
            self.connection.shutdown(socket.SHUT_RDWR)


class Door(socket.socket):
    """The listening socket, which asyncio asks for each new connection.

    A client with too many connections loses the oldest on which no request is being answered, so
    that one who only holds them open keeps nobody out, not even from the same machine. On Windows
    asyncio takes up connections without asking.
    """

    def __init__(self, family: int, kind: int, protocol: int) -> None:
        super().__init__(family, kind, protocol)
        self._guests: list[_Guest] = []
        self._spare: int | None = os.open(os.devnull, os.O_RDONLY)
        self._most = _most_in_all()
        self._said_s = -SAY_EVERY_S

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection.

        Raises:
            BlockingIOError: there is none, or others should have a turn before the next.
        """
        for _ in range(MOST_TURNED_AWAY):
            if sum(guest.turned_out and guest.is_open for guest in self._guests) >= MOST_LEAVING:
                break
            connection, address = self._take()
            source = source_of(address[0])
            if self._makes_room(source):
                guest = _Guest(connection, source)
                self._guests.append(guest)
                asyncio.get_running_loop().call_later(HEADERS_S, _end_without_tls, guest)
                return connection, address
            connection.close()
        raise BlockingIOError

    def served_by(self, handle: int, protocol: "LimitedProtocol") -> None:
        """A connection, by its file handle, has got its protocol."""
        for guest in reversed(self._guests):
            if guest.connection.fileno() == handle:
                guest.protocol = protocol
                return

    def close(self) -> None:
        """Take up no more connections."""
        super().close()
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None

    def _take(self) -> tuple[socket.socket, Any]:
        """Take up a connection; without a file handle for it, turn it away.

        asyncio would log that without end, and a connection that nobody takes up wakes it at once.
        """
        try:
            return super().accept()
        except OSError as error:
            if error.errno not in (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM):
                raise
            if monotonic() - self._said_s >= SAY_EVERY_S:
                self._said_s = monotonic()
                _LOG.warning(
                    "Connections are turned away: %s. Close other programs, or raise `ulimit -n`.",
                    error.strerror,
                )
        for source, _ in Counter(guest.source for guest in self._guests).most_common(1):
            self._turn_out_from(source)
        if self._spare is not None:
            os.close(self._spare)
            self._spare = None
            with suppress(OSError):
                super().accept()[0].close()
        with suppress(OSError):
            self._spare = os.open(os.devnull, os.O_RDONLY)
        if self._spare is None:  # not even that: wait a moment rather than try without end
            sleep(0.05)
        raise BlockingIOError

    def _makes_room(self, source: str) -> bool:
        """Whether a connection from there may stay; the oldest that only waits has to go for it."""
        self._guests = [guest for guest in self._guests if guest.is_open]
        crowd = Counter(guest.source for guest in self._guests if not guest.turned_out)
        if crowd[source] >= MOST_OF_ONE:
            return self._turn_out_from(source)
        return crowd.total() < self._most or self._turn_out_from(crowd.most_common(1)[0][0])

    def _turn_out_from(self, source: str) -> bool:
        for guest in self._guests:  # the oldest is first
            if guest.source == source and guest.is_waited_for and not guest.turned_out:
                guest.turn_out()
                return True
        return False


class LimitedProtocol(H11Protocol):
    """HTTP/1.1 that ends a connection whose client is too slow to ask, or to take the answer."""

    def __init__(self, door: Door, **given: Any) -> None:
        super().__init__(**given)
        self._door = door
        self._awaited: object = None  # the state in which the deadline was set
        self._deadline: asyncio.TimerHandle | None = None
        self._reader_deadline: asyncio.TimerHandle | None = None

    @property
    def is_waited_for(self) -> bool:
        """Whether the client has to go on: no whole request of it has come yet."""
        return self.conn.their_state in (h11.IDLE, h11.SEND_BODY)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Wait for the first request."""
        super().connection_made(cast("asyncio.Transport", transport))
        self._door.served_by(transport.get_extra_info("socket").fileno(), self)
        self._set_deadline()

    def data_received(self, data: bytes) -> None:
        """Take up bytes; one after another they do not put the deadline off."""
        super().data_received(data)
        self._set_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the deadlines."""
        for deadline in (self._deadline, self._reader_deadline):
            if deadline is not None:
                deadline.cancel()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """Wait until the client has taken up what was sent."""
        super().pause_writing()
        self._reader_deadline = self.loop.call_later(ANSWER_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on sending."""
        super().resume_writing()
        if self._reader_deadline is not None:
            self._reader_deadline.cancel()
            self._reader_deadline = None

    def _set_deadline(self) -> None:
        state = self.conn.their_state
        if state is self._awaited:
            return
        if self._deadline is not None:
            self._deadline.cancel()
        limit_s = {h11.IDLE: HEADERS_S, h11.SEND_BODY: BODY_S}.get(state)
        self._awaited = None if limit_s is None else state
        self._deadline = (
            None if limit_s is None else self.loop.call_later(limit_s, self.transport.abort)
        )


def _end_without_tls(guest: _Guest) -> None:
    if guest.protocol is None and guest.is_open:
        guest.turn_out()


def _most_in_all() -> int:
    """Connections at a time, of as many file handles as this program may have."""
    try:
        from resource import RLIM_INFINITY, RLIMIT_NOFILE, getrlimit
    except ImportError:  # Windows has no such limit
        return MOST_IN_ALL
    handles, _ = getrlimit(RLIMIT_NOFILE)
    if handles == RLIM_INFINITY:
        return MOST_IN_ALL
    return max(FEWEST_IN_ALL, min(MOST_IN_ALL, handles - KEPT_FREE))
