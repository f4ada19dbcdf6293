"""Who does not come in at a broker with the files of deploy/, and what our edge node says: one line, with the way out."""

import socket
import ssl
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from subprocess import CalledProcessError, run
from threading import Thread

import pytest

from sparkplug.broker import BrokerAddress
from sparkplug.edge_node import EdgeNode
from sparkplug.metric import NodeId
from tests.deploy.plant import PASSWORD_EDGES, PEOPLE, Plant, certificates, need_programs, with_version
from tests.deploy.wire_client import WireClient

pytestmark = pytest.mark.broker
NODE = NodeId("cnc", "edge-okuma")
PAST = ("--from", "20200101000000Z", "--until", "20210101000000Z")
FUTURE = ("--from", "20400101000000Z", "--until", "20410101000000Z")


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> Iterator[Plant]:
    """A plant that has given out certificates of every kind, and a second authority beside it."""
    assert mosquitto_program
    need_programs()
    plant = Plant(tmp_path_factory.mktemp("strict"))
    plant.build()
    for name, options in (("past", PAST), ("future", FUTURE), ("stolen", ())):
        certificates("client", plant.authority, name, *options)
    certificates("server", plant.authority, "old-broker", "--host", "127.0.0.1", *PAST)
    certificates("server", plant.authority, "elsewhere", "--host", "broker.elsewhere.example")
    certificates("init", plant.home / "other")
    certificates("client", plant.home / "other", "edge-okuma")
    plant.start()
    yield plant
    plant.stop()


def what_is_said(address: BrokerAddress) -> str:
    """The error of an edge node at this address, which must not come in."""
    edge = EdgeNode(address, NODE)
    edge.start()
    deadline_s = time.monotonic() + 60.0
    while not (edge.last_error or edge.online) and time.monotonic() < deadline_s:
        time.sleep(0.01)
    online, error = edge.online, edge.last_error
    edge.stop()
    assert not online
    assert "\n" not in error
    assert "pass word" not in error
    return error


def address_with(strict: Plant, papers: str) -> BrokerAddress:
    """An edge node's address with papers that something is wrong with."""
    good = strict.of("edge-okuma")
    foreign = strict.home / "other"
    return {
        "expired": lambda: strict.with_certificate("past"),
        "not valid yet": lambda: strict.with_certificate("future"),
        "of another authority": lambda: strict.with_certificate("edge-okuma", authority=foreign),
        "none": lambda: replace(good, certificate_file=None, key_file=None),
        "a server's": lambda: strict.with_certificate("broker"),
        "key of another": lambda: replace(good, key_file=strict.authority / "edge-other.key"),
        "trusts another authority": lambda: replace(good, ca_file=foreign / "ca.pem"),
        "wrong password": lambda: strict.with_password("edge-mill", PASSWORD_EDGES).with_password("wrong"),
        "unknown user": lambda: strict.with_password("edge-nobody", PASSWORD_EDGES),
        "password of another": lambda: replace(strict.with_password("edge-mill", PASSWORD_EDGES), username="edge-okuma"),
        "no password": lambda: replace(strict.with_password("edge-mill", PASSWORD_EDGES), username=None, password=None),
        "a reader at the edges' door": lambda: strict.with_password("viewer", PASSWORD_EDGES),
        "an edge at the readers' door": lambda: strict.with_password("edge-mill", PEOPLE),
    }[papers]()


@pytest.mark.parametrize("version", [4, 5], ids=["MQTT 3.1.1", "MQTT 5"])
@pytest.mark.parametrize(
    ("papers", "said"),
    [
        ("expired", "past.pem has expired; make a new one"),
        ("not valid yet", "future.pem is not valid, or not valid yet; compare its dates with the clock of the broker"),
        ("of another authority", "edge-okuma.pem comes from an authority that it does not know"),
        ("none", "the broker wants a certificate of us; give certificate_file and key_file"),
        ("a server's", "broker.pem is not made for clients"),
        ("key of another", "edge-other.key does not belong to certificate_file"),
        ("trusts another authority", "the certificate of the broker comes from an authority that we do not know"),
        ("wrong password", "refused the connection: Not authorized"),
        ("unknown user", "refused the connection: Not authorized"),
        ("password of another", "refused the connection: Not authorized"),
        ("no password", "refused the connection: Not authorized"),
        ("a reader at the edges' door", "refused the connection: Not authorized"),
        ("an edge at the readers' door", "refused the connection: Not authorized"),
    ],
)
def test_an_edge_with_wrong_papers_stays_outside_and_learns_why(strict: Plant, papers: str, said: str, version: int) -> None:
    assert said in what_is_said(with_version(address_with(strict, papers), version))


def test_a_revoked_certificate_is_refused_from_the_next_start_of_the_broker_on(strict: Plant) -> None:
    with WireClient(strict.with_certificate("stolen")):
        pass
    assert "revoked 1 of stolen" in certificates("revoke", strict.authority, "stolen")
    strict.take_new_crl()
    assert "stolen.pem is revoked; make a new one" in what_is_said(strict.with_certificate("stolen"))
    with WireClient(strict.of("edge-okuma")):
        pass


def test_a_certificate_is_renewed_while_the_old_one_still_counts(strict: Plant, tmp_path: Path) -> None:
    for name in ("edge-other.pem", "edge-other.key"):
        (tmp_path / name).write_bytes((strict.authority / name).read_bytes())
    with pytest.raises(CalledProcessError):
        certificates("client", strict.authority, "edge-other")
    certificates("client", strict.authority, "edge-other", "--renew")
    for folder in (tmp_path, strict.authority):
        with WireClient(strict.with_certificate("edge-other", authority=folder)):
            pass
    certificates("revoke", strict.authority, "edge-other", "--older")
    strict.take_new_crl()
    assert "edge-other.pem is revoked" in what_is_said(strict.with_certificate("edge-other", authority=tmp_path))
    with WireClient(strict.of("edge-other")):
        pass


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("old-broker", "the certificate of the broker has expired; give the broker a new one"),
        ("elsewhere", "the certificate of the broker is made out to other addresses than 127.0.0.1"),
        ("edge-other", "the certificate of the broker is not made for servers: a client may be posing as the broker"),
    ],
)
def test_an_edge_does_not_talk_to_who_only_poses_as_the_broker(strict: Plant, name: str, said: str) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(strict.authority / f"{name}.pem", strict.authority / f"{name}.key")
    with Impostor(context) as impostor:
        assert said in what_is_said(replace(strict.of("edge-okuma"), port=impostor.port))
    assert impostor.heard == b""


class Impostor:
    """A server with a certificate that it should not have."""

    def __init__(self, context: ssl.SSLContext) -> None:
        self.heard = b""
        self._context = context
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(0.1)
        self.port: int = self._listener.getsockname()[1]
        self._is_over = False
        self._thread = Thread(target=self._serve)

    def __enter__(self) -> "Impostor":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over = True
        self._thread.join()
        self._listener.close()

    def _serve(self) -> None:
        while not self._is_over:
            try:
                client, _ = self._listener.accept()
            except TimeoutError:
                continue
            client.settimeout(1.0)
            with client:
                try:
                    with self._context.wrap_socket(client, server_side=True) as secured:
                        self.heard += secured.recv(1000)
                except OSError:
                    continue


def test_keys_are_for_their_owner_only_and_no_authority_is_made_in_a_repository(strict: Plant) -> None:
    for key in (*strict.authority.glob("*.key"), strict.authority / "index"):
        assert key.stat().st_mode & 0o077 == 0, key
    assert strict.authority.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("client", "a/b"), "'/', '+' and '#' would reach beyond a topic level"),
        (("client", "+"), "'/', '+' and '#' would reach beyond a topic level"),
        (("client", "a b"), "use letters, digits"),
        (("client", "twin-mirror"), "belong to the processors"),
        (("client", "ca"), "is taken by the authority"),
        (("server", "b"), "a server needs --host"),
        (("client", "edge-okuma"), "replace it with --renew"),
        (("revoke", "nobody"), "there is no valid certificate of 'nobody'"),
        (("init",), "is there already; a new authority makes all certificates of the old one useless"),
        (("keystore", "broker"), "put the password of the key store into the variable KEYSTORE_PASSWORD"),
        (("client",), "client needs a name"),
        (("clinet",), "clinet is none of"),
        (("client", "x", "--dyas", "3"), "--dyas is no option"),
    ],
)
def test_the_script_refuses_what_would_go_wrong_later(strict: Plant, arguments: tuple[str, ...], said: str) -> None:
    verb, *rest = arguments
    with pytest.raises(CalledProcessError) as failure:
        certificates(verb, strict.authority, *rest)
    assert failure.value.returncode == 2
    assert said in failure.value.stderr
    assert failure.value.stderr.count("\n") == 1


def test_no_keys_are_made_inside_a_repository(tmp_path: Path) -> None:
    run(["git", "init", "-q", str(tmp_path)], check=True)
    with pytest.raises(CalledProcessError) as failure:
        certificates("init", tmp_path / "deep" / "inside")
    assert "keys must never be committed" in failure.value.stderr
    assert not (tmp_path / "deep").exists()
