"""Getting in: the endpoint, trust, users, and what is said when it does not work."""

import asyncio
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("asyncua")

from asyncua import ua

from edge.controls.opcua import session
from edge.controls.opcua.check import describe
from edge.controls.opcua.config import Config
from edge.controls.opcua.library import ForbiddenServiceError
from edge.errors import ConfigError, ConnectionLostError
from tests.edge.controls.opcua.conftest import NOW_S, Bench


def endpoint(policy: str, mode: str) -> ua.EndpointDescription:
    uri = f"http://opcfoundation.org/UA/SecurityPolicy#{policy}"
    return ua.EndpointDescription(
        EndpointUrl="opc.tcp://mill:4840",
        SecurityMode=ua.MessageSecurityMode[mode],
        SecurityPolicyUri=uri,
        ServerCertificate=b"c",
    )


NONE, OLD = endpoint("None", "None_"), endpoint("Basic256", "SignAndEncrypt")
GOOD, BETTER = endpoint("Basic256Sha256", "SignAndEncrypt"), endpoint("Aes256_Sha256_RsaPss", "SignAndEncrypt")
SIGNED = endpoint("Aes256_Sha256_RsaPss", "Sign")


@pytest.mark.parametrize(
    ("wanted", "offered", "expected"),
    [
        ("auto", [NONE, GOOD, SIGNED], "Basic256Sha256:SignAndEncrypt"),
        ("auto", [NONE, GOOD, BETTER, SIGNED], "Aes256Sha256RsaPss:SignAndEncrypt"),
        ("auto", [SIGNED, NONE], "Aes256Sha256RsaPss:Sign"),
        ("Basic256Sha256:SignAndEncrypt", [NONE, GOOD, BETTER], "Basic256Sha256:SignAndEncrypt"),
    ],
)
def test_the_best_that_is_offered_is_taken_or_the_one_that_is_wanted(wanted: str, offered: list[object], expected: str) -> None:
    chosen = session.choose("opc.tcp://mill:4840", wanted, offered)  # type: ignore[arg-type]
    assert chosen is not None
    assert f"{chosen.policy}:{chosen.mode}" == expected


@pytest.mark.parametrize(
    ("wanted", "offered"), [("auto", [NONE]), ("auto", [NONE, OLD]), ("auto", []), ("Basic256Sha256:Sign", [GOOD])]
)
def test_without_security_that_is_safe_there_is_no_connection_unless_the_file_says_so(wanted: str, offered: list[object]) -> None:
    with pytest.raises(ConnectionLostError, match=r'or set opcua\.security = "none" and accept') as refused:
        session.choose("opc.tcp://mill:4840", wanted, offered)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
    assert session.choose("opc.tcp://mill:4840", "none", offered) is None  # type: ignore[arg-type]


def reached(config: Config) -> tuple[str, str, session.ServerStatus]:
    async def there() -> tuple[str, str, session.ServerStatus]:
        async with session.opened(config) as client:
            return client.security_policy.URI, client.security_policy.Mode.name, await session.read_status(client)

    return asyncio.run(there())


def test_auto_is_encrypted_with_the_best_policy_of_the_server(bench: Bench) -> None:
    uri, mode, status = reached(bench.config())
    assert uri.endswith("#Aes256_Sha256_RsaPss")
    assert mode == "SignAndEncrypt"
    assert status.state == "Running"
    assert status.current_ms == round((NOW_S + bench.machine_s) * 1000)


def test_a_server_that_was_never_trusted_is_refused(bench: Bench, tmp_path: Path) -> None:
    with pytest.raises(ConnectionLostError, match="is not trusted yet"):
        describe(bench.config(server_fingerprint="", certificate_folder=str(tmp_path)))


def test_no_security_is_had_for_the_asking_and_check_says_what_it_means(bench: Bench) -> None:
    *rows, warning = describe(bench.config(security="none"))
    assert {row.signal: row.value for row in rows}["tool_number"] == 3
    assert warning.reason == 'opcua.security = "none": anyone in between can read and alter what the control says'


def test_a_user_comes_in_by_password_from_the_environment(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    config = bench.config(username="edge", password_env="MILL_PASSWORD")
    monkeypatch.delenv("MILL_PASSWORD", raising=False)
    with pytest.raises(ConfigError, match=r"opcua\.password_env = 'MILL_PASSWORD': no such environment variable"):
        reached(config)
    monkeypatch.setenv("MILL_PASSWORD", "guess")
    with pytest.raises(ConnectionLostError, match=r"the server refuses the user \(Bad\w+\); check opcua\.username"):
        reached(config)
    monkeypatch.setenv("MILL_PASSWORD", "open sesame")
    assert reached(config)[2].state == "Running"


def test_a_user_comes_in_by_certificate(bench: Bench) -> None:
    mine = {"user_certificate": str(bench.user.certificate), "user_key": str(bench.user.key)}
    assert reached(bench.config(**mine))[2].state == "Running"
    other = session.own_identity(bench.folder / "stranger", name="stranger")
    stolen = {"user_certificate": str(bench.user.certificate), "user_key": str(other.key)}
    with pytest.raises(ConnectionLostError, match="the server refuses the user"):
        reached(bench.config(**stolen))
    with pytest.raises(ConfigError, match=r"opcua\.user_certificate = '/nowhere': cannot be read"):
        reached(bench.config(user_certificate="/nowhere", user_key="/nowhere"))


def test_a_request_that_writes_does_not_leave_the_house(bench: Bench) -> None:
    async def write() -> None:
        async with session.opened(bench.config(security="none")) as client:
            await client.get_node(ua.NodeId("/Channel/State/actTNumber[u1,1]", 2)).write_value(7)

    with pytest.raises(ForbiddenServiceError, match="WriteRequest is not sent"):
        asyncio.run(write())
    assert bench.server.writes == 0


@pytest.fixture
def stranger() -> Iterator[int]:
    """A port where something else listens: it answers each request in HTTP, or the third one not at all."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(0.1)
        over = threading.Event()

        def serve() -> None:
            while not over.is_set():
                try:
                    answering, _ = listening.accept()
                except TimeoutError:
                    continue
                with answering:
                    answering.recv(4096)
                    answering.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 20)

        thread = threading.Thread(target=serve)
        thread.start()
        port: int = listening.getsockname()[1]
        yield port
        over.set()
        thread.join()


def test_what_is_no_opc_ua_server_is_told_in_one_line_and_in_time(bench: Bench, stranger: int) -> None:
    begun_s = time.monotonic()
    with pytest.raises(ConnectionLostError) as refused:
        reached(bench.config(url=f"opc.tcp://127.0.0.1:{stranger}", timeout_s=0.5))
    assert "\n" not in str(refused.value)
    assert time.monotonic() - begun_s < 5.0
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        with pytest.raises(ConnectionLostError, match="is the server running, and the address right"):
            reached(bench.config(url=f"opc.tcp://127.0.0.1:{free.getsockname()[1]}", timeout_s=0.5))
