"""A console under attack: half-open and slow connections, floods, clients that go away."""

import asyncio
import errno
import logging
import os
import re
import socket
import time
from http.client import HTTPConnection

import pytest

from steerlab.app.console import connections
from steerlab.app.console.change_feed import MOST_OF_ONE
from steerlab.app.console.few_messages import MOST_MESSAGES, FewMessages
from steerlab.app.console.sign_in import source_of


def _connect(address):
    return socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2])), timeout=10)


def _ask(connection, served, path="/", method="GET", more=""):
    host = served.address.removeprefix("http://")
    connection.sendall(f"{method} {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n".encode())


def _status(connection):
    return int(connection.recv(2000).split()[1])


def _form(length):
    return f"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: {length}\r\n"


def _is_ended(connection):
    try:
        while connection.recv(2000):
            pass
    except ConnectionError:
        return True
    except TimeoutError:
        return False
    return True


@pytest.fixture
def short(monkeypatch):
    """Limits that a test can wait for."""
    for name in ("HEADERS_S", "BODY_S", "ANSWER_S"):
        monkeypatch.setattr(connections, name, 0.3)


@pytest.mark.parametrize("sent", ["", "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: "])
def test_a_connection_that_asks_for_nothing_is_ended(short, served, sent):
    with _connect(served.address) as connection:
        connection.sendall(sent.encode())
        assert _is_ended(connection)


def test_one_byte_after_another_does_not_put_the_deadline_off(short, served):
    with _connect(served.address) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\nX: ")
        assert _ends_it(connection, b"a")


def _ends_it(connection, bytes_of_it):
    """Whether the console ends the connection while these come again and again."""
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        try:
            connection.sendall(bytes_of_it)
            time.sleep(0.01)
        except TimeoutError:  # the console takes up no more of them
            continue
        except OSError:
            return True
    return False


@pytest.mark.parametrize("origin", [True, False])  # without it is refused before it is read
def test_a_body_that_does_not_end_is_not_waited_for(short, served, caplog, origin):
    more = _form(1000) + (f"Origin: {served.address}\r\n" if origin else "")
    with _connect(served.address) as connection:
        _ask(connection, served, "/sign-in", "POST", more)
        connection.sendall(b"code=")
        if not origin:
            assert _status(connection) == 403
        assert _is_ended(connection)
    assert caplog.records == []


def test_a_client_that_takes_up_no_answer_is_let_go(short, served):
    with _connect(served.address) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(0.2)
        host = served.address.removeprefix("http://")
        question = f"GET /static/console.css HTTP/1.1\r\nHost: {host}\r\n\r\n"
        assert _ends_it(connection, 50 * question.encode())


def test_a_page_may_pause_between_two_requests(short, served):
    host, _, port = served.address.removeprefix("http://").partition(":")
    connection = HTTPConnection(host, int(port), timeout=10)
    connection.connect()
    used = connection.sock
    for _ in range(2):
        connection.request("GET", "/static/none")
        answer = connection.getresponse()
        assert (answer.status, answer.read() != b"") == (404, True)
        time.sleep(0.6)
    assert connection.sock is used
    connection.close()


def test_whoever_holds_many_connections_open_keeps_nobody_out(served, monkeypatch):
    monkeypatch.setattr(connections, "MOST_OF_ONE", 5)
    held = [_connect(served.address) for _ in range(40)]
    try:
        for connection in held:  # half-open ones, and such as asked once and then only wait
            connection.sendall(b"GET / HTTP/1.1\r\n")
        with _connect(served.address) as connection:
            _ask(connection, served)
            assert _status(connection) == 401
        assert sum(not _is_open(connection) for connection in held) >= 35
    finally:
        for connection in held:
            connection.close()


def _is_open(connection):
    connection.setblocking(False)
    try:
        return connection.recv(100) != b""
    except BlockingIOError:
        return True
    except ConnectionError:
        return False


def test_the_client_with_most_connections_loses_one_when_there_are_too_many(monkeypatch):
    monkeypatch.setattr(connections, "FEWEST_IN_ALL", 3)
    monkeypatch.setattr(connections, "MOST_IN_ALL", 3)
    sources = iter(["flood", "flood", "flood", "calm"])
    monkeypatch.setattr(connections, "source_of", lambda host: next(sources))

    async def take_up():
        with connections.Door(socket.AF_INET, socket.SOCK_STREAM, 0) as door:
            door.bind(("127.0.0.1", 0))
            door.listen()
            clients = [socket.create_connection(door.getsockname()) for _ in range(4)]
            taken = [door.accept()[0] for _ in clients]
            clients[0].settimeout(5)
            assert clients[0].recv(1) == b""  # the oldest of the flood
            assert all(_is_open(one) for one in clients[1:])
            for one in (*clients, *taken):
                one.close()

    asyncio.run(take_up())


def test_without_file_handles_connections_are_turned_away_with_one_message(monkeypatch, caplog):
    async def knock():
        with connections.Door(socket.AF_INET, socket.SOCK_STREAM, 0) as door:
            door.bind(("127.0.0.1", 0))
            door.listen()
            door.setblocking(False)
            for _ in range(5):
                client = socket.create_connection(door.getsockname())
                client.settimeout(5)
                with monkeypatch.context() as patch:
                    fail = [OSError(errno.EMFILE, os.strerror(errno.EMFILE))]
                    real = socket.socket.accept
                    patch.setattr(
                        socket.socket,
                        "accept",
                        lambda door, fail=fail, real=real: _raise(fail) if fail else real(door),
                    )
                    with pytest.raises(BlockingIOError):
                        door.accept()
                assert client.recv(1) == b""  # taken out of the queue: it wakes nobody any more
                client.close()

    asyncio.run(knock())
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    assert "ulimit -n" in caplog.text


def _raise(errors):
    raise errors.pop()


def test_the_console_leaves_file_handles_for_everything_else(monkeypatch):
    resource = pytest.importorskip("resource")
    for handles, most in ((1024, 400), (256, 106), (64, 16), (resource.RLIM_INFINITY, 400)):
        monkeypatch.setattr(resource, "getrlimit", lambda what, n=handles: (n, n))
        assert connections._most_in_all() == most


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("192.168.1.20", "192.168.1.21", False),
        ("192.168.1.20", "::ffff:192.168.1.20", True),
        ("2001:db8::1", "2001:db8::ffff:1", True),  # one network: a client has all of it
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("fe80::1%eth0", "fe80::2", True),
        ("testclient", "testclient", True),
    ],
)
def test_what_counts_as_one_client(one, other, same):
    assert (source_of(one) == source_of(other)) == same


# Clients that go away


def test_a_client_that_goes_away_is_no_traceback(served, caplog):
    _, token = _participant(served)
    for path, more, body in (
        ("/sign-in", _form(1000), b"code=a"),
        (f"/p/{token}/consent", "Content-Type: application/x-www-form-urlencoded\r\n", b""),
        (f"/p/{token}/consent", _form(100), b"decision=yes&vers"),
    ):
        with _connect(served.address) as connection:
            _ask(connection, served, path, "POST", f"Origin: {served.address}\r\n{more}")
            connection.sendall(body)
    for path in ("/", f"/p/{token}", f"/p/{token}/events"):
        with _connect(served.address) as connection:
            _ask(connection, served, path)
    with _connect(served.address) as connection:  # still serves, after all of them
        _ask(connection, served)
        assert _status(connection) == 401
    assert [record.getMessage() for record in caplog.records] == []


def _participant(served):
    view = served.study.enrol("training")
    return view.id, served.study.new_link(view.id)


# Streams


def test_streams_are_limited_per_participant_even_if_all_come_at_once(served):
    (_, token), (_, other) = _participant(served), _participant(served)
    streams = [_connect(served.address) for _ in range(3 * MOST_OF_ONE)]
    try:
        for stream in streams:
            _ask(stream, served, f"/p/{token}/events")
        statuses = [_status(stream) for stream in streams]
        assert statuses.count(200) == MOST_OF_ONE
        assert statuses.count(503) == 2 * MOST_OF_ONE
        with _connect(served.address) as stream:
            _ask(stream, served, f"/p/{other}/events")
            assert _status(stream) == 200
    finally:
        for stream in streams:
            stream.close()
    _eventually(lambda: _stream_opens(served, token))


def _stream_opens(served, token):
    with _connect(served.address) as stream:
        _ask(stream, served, f"/p/{token}/events")
        return _status(stream) == 200


def _eventually(holds):
    for _ in range(500):
        if holds():
            return
        time.sleep(0.02)
    raise AssertionError("it never came to hold")


def test_a_stream_counts_before_it_is_answered(lab):
    async def key():
        return "a"

    given = [lab.changes.response(key, "P01") for _ in range(MOST_OF_ONE + 1)]
    assert given[-1] is None
    assert None not in given[:-1]


# Messages


def test_a_flood_of_nonsense_says_little_in_the_terminal(caplog):
    now = [0.0]
    logger = logging.getLogger("steerlab.test.flood")
    limit = FewMessages(clock=lambda: now[0])
    logger.addFilter(limit)
    try:
        for _ in range(1000):
            logger.warning("Invalid request from %s.", "a client")
        assert len(caplog.records) == MOST_MESSAGES
        assert caplog.records[0].getMessage() == "Invalid request from a client."
        assert re.search(r"client\. \(More of this .* left out\.\)$", caplog.messages[-1])
        now[0] = 61.0
        logger.warning("Later.")
        assert caplog.messages[-1] == "Later."
    finally:
        logger.removeFilter(limit)
