"""A relay between clients and a pit, a process of its own run by its path: a network with a delay, which can be cut or stopped.

It passes on every byte a little later, in both directions. Killed, it is a network whose connections are reset; stopped, one that
swallows everything for a while. It needs no rights, unlike network namespaces.
"""

import asyncio
import sys


class _Half(asyncio.Protocol):
    """One end of a connection; what comes here leaves at the other end."""

    def __init__(self, delay_s: float) -> None:
        self.other: _Half | None = None
        self._delay_s = delay_s
        self._waiting: list[bytes] = []
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def join(self, other: "_Half") -> None:
        """Pass on what comes from now on, and what came before."""
        self.other = other
        for data in self._waiting:
            self.data_received(data)
        self._waiting.clear()

    def data_received(self, data: bytes) -> None:
        if self.other is None:
            self._waiting.append(data)
        else:
            asyncio.get_running_loop().call_later(self._delay_s, self.other.write, data)

    def write(self, data: bytes) -> None:
        """Send what came at the other end."""
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(data)

    def connection_lost(self, error: Exception | None) -> None:
        self._transport = None
        if self.other is not None:
            self.other.close()

    def close(self) -> None:
        """End the connection."""
        if self._transport is not None:
            self._transport.close()


class _Client(_Half):
    """The end of a connection at which somebody came."""

    def __init__(self, port: int, delay_s: float) -> None:
        super().__init__(delay_s)
        self._port = port

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._task = asyncio.get_running_loop().create_task(self._connect())

    async def _connect(self) -> None:
        try:
            _, pit = await asyncio.get_running_loop().create_connection(lambda: _Half(self._delay_s), "127.0.0.1", self._port)
        except OSError:
            self.close()
            return
        pit.join(self)
        self.join(pit)
        if self._transport is None:  # it left meanwhile
            pit.close()


async def relay(port: int, pit_port: int, delay_s: float) -> None:
    """Pass on what comes to one port of loopback to another, and back, for ever."""
    loop = asyncio.get_running_loop()
    server = await loop.create_server(lambda: _Client(pit_port, delay_s), "127.0.0.1", port)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(relay(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
