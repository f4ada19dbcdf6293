"""Servers that are stopped at the end of their test."""

from collections.abc import Iterator

import pytest

from cnctwin.standins.focas_server.server import FocasServer
from cnctwin.standins.focas_server.shown import ControlDescription
from cnctwin.standins.simulated_control.state import ControlState
from tests.cnctwin.standins.focas_server.moments import CHANGING, DESCRIPTION, Serve, control_at


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Starts servers and stops them."""
    started: list[FocasServer] = []

    def serve_(
        *states: ControlState, description: ControlDescription = DESCRIPTION, at_s: float = 0.0, **more: int
    ) -> FocasServer:
        server = FocasServer(control_at(*(states or (CHANGING,)), at_s=at_s), description, **more)
        server.start()
        started.append(server)
        return server

    yield serve_
    for server in started:
        server.stop()
