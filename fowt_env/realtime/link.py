"""Connects a server with one client at a time, over TCP or UDP."""

import socket
from abc import ABC, abstractmethod
from select import select
from time import monotonic

from fowt_env.errors import InputError
from fowt_env.realtime.record import (
    HEADER,
    LARGEST,
    Kind,
    Malformed,
    Record,
    json_record,
    size_of,
    unpack,
)

MOST = 64  # packets taken at once
GOODBYE = 0.5  # s in which a client reads the last records
OCCUPIED = "another client is connected: a server has one client at a time"


class Link(ABC):
    """Receives records of the client and sends records to it; counts what it refuses.

    A client that has sent no valid record for `patience` seconds is replaced by the next one that connects.
    """

    sockets: list[socket.socket]  # to wait for

    def __init__(self, patience: float) -> None:
        self.patience = patience
        self.malformed = 0  # packets
        self.refused = 0  # clients
        self.connections = 0  # clients accepted
        self._heard = 0.0  # s, monotonic

    def receive(self, timeout: float) -> list[Record]:
        """Return the records of the client that arrive within a time, s; () at its end."""
        ready = select(self.sockets, (), (), timeout)[0]
        records = [record for each in ready for record in self._read(each)]
        if records:
            self._heard = monotonic()
        return records

    def _begin(self):
        """Count a new client."""
        self.connections += 1
        self._heard = monotonic()

    def _is_free(self, connected):
        """Return whether a new client may take the place of the present one."""
        return not connected or monotonic() - self._heard > self.patience

    @property
    @abstractmethod
    def address(self) -> tuple[str, int]:
        """Return the host and port at which the server listens."""

    @abstractmethod
    def _read(self, ready):
        """Return the records that a socket holds."""

    @abstractmethod
    def send(self, data: bytes | bytearray) -> None:
        """Send a record to the client, if there is one; a client that does not read loses its connection."""

    @abstractmethod
    def close(self) -> None:
        """Close all sockets."""

    def refuse(self, reason: str) -> None:
        """Count a malformed packet and tell the client the reason."""
        self.malformed += 1
        self.send(json_record(Kind.REFUSED, {"reason": reason}))


class TcpLink(Link):
    """Connects over TCP; a stream that cannot be read as records is closed."""

    def __init__(self, host: str, port: int, patience: float) -> None:
        super().__init__(patience)
        self._listener = _bound(socket.SOCK_STREAM, host, port)
        self._listener.listen()
        self._client: socket.socket | None = None
        self._buffer = bytearray()
        self.sockets = [self._listener]

    @property
    def address(self) -> tuple[str, int]:
        return self._listener.getsockname()[:2]

    def _read(self, ready):
        if ready is self._listener:
            self._accept()
            return []
        if ready is not self._client:  # replaced since
            return []
        try:
            content = self._client.recv(MOST * LARGEST)
        except BlockingIOError:
            return []
        except OSError:
            content = b""
        if not content:
            self._drop()
            return []
        self._buffer += content
        return self._records()

    def _records(self):
        """Return the complete records of the buffer and remove them."""
        records = []
        try:
            while (length := size_of(self._buffer)) and length <= len(self._buffer):
                records.append(unpack(self._buffer[:length]))
                del self._buffer[:length]
        except Malformed as error:
            self.refuse(f"{error}; the connection is closed")
            self._drop()
        return records

    def _accept(self):
        try:
            client, _ = self._listener.accept()
        except OSError:
            return
        client.setblocking(False)
        if not self._is_free(self._client is not None):
            self.refused += 1
            with client:
                client.send(json_record(Kind.REFUSED, {"reason": OCCUPIED}))
            return
        self._drop()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client
        self.sockets = [self._listener, client]
        self._begin()

    def _drop(self):
        """Close the connection with the client, if there is one."""
        if self._client is not None:
            self._client.close()
        self._client = None
        self._buffer.clear()
        self.sockets = [self._listener]

    def send(self, data: bytes | bytearray) -> None:
        if self._client is None:
            return
        try:
            if self._client.send(data) < len(data):
                self._drop()
        except OSError:
            self._drop()

    def close(self) -> None:
        if self._client is not None:
            try:  # unread commands would reset the connection, and the client would lose the last records
                self._client.shutdown(socket.SHUT_WR)
                self._client.settimeout(GOODBYE)
                while self._client.recv(LARGEST):
                    pass
            except OSError:
                pass
        self._drop()
        self._listener.close()


class UdpLink(Link):
    """Connects over UDP; the client is the address of the last HELLO that was accepted."""

    def __init__(self, host: str, port: int, patience: float) -> None:
        super().__init__(patience)
        self._socket = _bound(socket.SOCK_DGRAM, host, port)
        self._client: tuple | None = None
        self.sockets = [self._socket]

    @property
    def address(self) -> tuple[str, int]:
        return self._socket.getsockname()[:2]

    def _read(self, ready):
        records = []
        for _ in range(MOST):
            try:
                content, sender = ready.recvfrom(HEADER.size + LARGEST + 1)
            except OSError:
                break
            record = self._of(content, sender)
            if record is not None:
                records.append(record)
        return records

    def _of(self, content, sender):
        """Return the record of a datagram; None for one that is malformed or not the client's."""
        try:
            record = unpack(content)
        except Malformed as error:
            if sender == self._client:
                self.refuse(str(error))
            else:
                self.malformed += 1
            return None
        if sender == self._client:
            return record
        if record.kind == Kind.HELLO and self._is_free(self._client is not None):
            self._client = sender
            self._begin()
            return record
        self.refused += 1
        if record.kind == Kind.HELLO:
            self._send(json_record(Kind.REFUSED, {"reason": OCCUPIED}), sender)
        return None

    def _send(self, data, receiver):
        try:
            self._socket.sendto(data, receiver)
        except OSError:  # nobody listens there, for now
            pass

    def send(self, data: bytes | bytearray) -> None:
        if self._client is not None:
            self._send(data, self._client)

    def close(self) -> None:
        # the answer to the last STATE would meet a closed port, whose error hides the END from the client
        if self._client is not None and select(self.sockets, (), (), GOODBYE)[0]:
            self._read(self._socket)
        self._socket.close()


LINKS = {"tcp": TcpLink, "udp": UdpLink}


def _bound(kind, host, port):
    """Return a non-blocking socket that listens at a host and port. Raises: InputError."""
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=kind, flags=socket.AI_PASSIVE)[0]
        bound = socket.socket(family, kind)
    except (OSError, OverflowError) as error:
        raise InputError(f"listen = {host}:{port}: {error}") from None
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
    except OSError as error:
        bound.close()
        raise InputError(f"listen = {host}:{port}: {error.strerror or error}") from None
    bound.setblocking(False)
    return bound
