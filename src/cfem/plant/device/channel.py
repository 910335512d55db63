"""Channels that carry bytes to a device and back: a serial port, or UDP. Bytes may be lost on the way."""

import socket
from contextlib import suppress
from typing import Protocol


class Channel(Protocol):
    """Bytes to a device and back. where: its name in messages."""

    where: str

    def open(self) -> None:
        """OSError where it cannot be opened."""
        ...

    def write(self, data: bytes) -> None:
        """Sends bytes; those that the device does not take are lost. OSError where the channel is gone."""
        ...

    def read(self, timeout: float) -> bytes:
        """Bytes that have come, or come first within `timeout` seconds; nothing after that. OSError as `write`."""
        ...

    def close(self) -> None:
        """Nothing where it is not open."""
        ...


class SerialChannel:
    """A serial port by its name, with 8 data bits, no parity and one stop bit. baud: bits a second."""

    def __init__(self, port: str, baud: int):
        self.port, self._baud, self._serial = port, baud, None
        self.where = f"device on serial port {port}"

    def open(self) -> None:
        from serial import Serial

        self._serial = Serial(self.port, self._baud, timeout=0.0, write_timeout=0.5)

    def write(self, data: bytes) -> None:
        from serial import SerialTimeoutException

        with suppress(SerialTimeoutException):
            self._serial.write(data)

    def read(self, timeout: float) -> bytes:
        if not self._serial.in_waiting:
            self._serial.timeout = timeout
            first = self._serial.read(1)
        else:
            first = b""
        return first + self._serial.read(self._serial.in_waiting)

    def close(self) -> None:
        if self._serial is not None:
            self._serial.close()


class UdpChannel:
    """Datagrams to a host and port, and those that come back."""

    def __init__(self, host: str, port: int):
        self._host, self._port, self._socket = host, port, None
        self.where = f"device at UDP {host}:{port}"

    def open(self) -> None:
        family, kind, protocol, _, address = socket.getaddrinfo(self._host, self._port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.connect(address)

    def write(self, data: bytes) -> None:
        with suppress(ConnectionError):  # nobody listens yet: silence says so
            self._socket.send(data)

    def read(self, timeout: float) -> bytes:
        self._socket.settimeout(timeout)
        try:
            return self._socket.recv(2**16)
        except (TimeoutError, BlockingIOError, ConnectionError):
            return b""

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
