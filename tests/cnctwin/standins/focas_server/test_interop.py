"""An independent client that knows nothing of us: pyfocas, from PyPI."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from pyfocas.protocol.packet import DecodingError, FOCASError
from pyfocas.protocol.protocol import FOCAS

from cnctwin.standins.focas_server.server import FocasServer
from tests.cnctwin.standins.focas_server.moments import CUTTING, Serve


@contextmanager
def pyfocas(server: FocasServer) -> Iterator[FOCAS]:
    client = FOCAS("127.0.0.1", server.port)
    try:
        assert client.connect()
        yield client
    finally:
        assert client.socket is not None
        client.socket.close()


def test_it_reads_what_the_control_is(serve: Serve) -> None:
    with pyfocas(serve()) as client:
        info = client.get_sys_info()
    assert (info.cnc_type, info.mt_type, info.series, info.version, info.axes) == ("31", "M", "G421", "40.1", "03")
    assert (info.addinfo, info.max_axis) == (0x0402, 32)


def test_it_reads_the_status_in_a_tool_change_and_after(serve: Serve) -> None:
    with pyfocas(serve()) as client:
        status = client.get_status_info()
    assert (status.aut, status.run, status.motion, status.mstb) == (1, 3, 0, 1)
    assert (status.emergency, status.alarm, status.edit) == (0, 0, 0)
    with pyfocas(serve(CUTTING)) as client:
        status = client.get_status_info()
    assert (status.motion, status.mstb) == (1, 0)


def test_it_reads_macros_and_takes_a_vacant_one_for_none(serve: Serve) -> None:
    with pyfocas(serve()) as client:
        assert client.read_macro(500, 501) == {500: 12.345, 501: -7.0}
        assert client.read_macro(4120) == {4120: 2.0}
        with pytest.raises(DecodingError):
            client.read_macro(502)
        with pytest.raises(FOCASError):
            client.read_macro(40_000)


def test_its_write_is_refused_and_changes_nothing(serve: Serve) -> None:
    server = serve()
    with pyfocas(server) as client:
        answer = client.write_macro_double(500, 99.0)
        assert answer.data[0][6:8] == b"\0\1"
        assert client.read_macro(500) == {500: 12.345}
    assert server.ledger["refused/write"] == 1
