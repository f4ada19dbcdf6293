"""URLs of servers, and where the secret comes from and never goes."""

import base64
import logging
import shutil
import ssl
import subprocess
from pathlib import Path

import pytest

from cnctwin.memory.store.contract import StoreError
from cnctwin.memory.store.influx.address import TOKEN, TOKEN_FILE, parse
from cnctwin.memory.store.influx.influx1 import Influx1
from cnctwin.memory.store.influx.influx2 import Influx2
from cnctwin.memory.store.influx.influx_reader import InfluxReader
from cnctwin.memory.store.influx.opening import open_influx
from cnctwin.memory.store.influx.server import Server, ServerAwayError
from cnctwin.memory.store.influx.victoria import Victoria
from tests.cnctwin.memory.store.influx.stand_in import Answer, HttpServer

SECRET = "s3cret-token-of-the-plant"


def test_a_url_says_where_and_how(tmp_path: Path) -> None:
    ca = tmp_path / "plant.pem"
    ca.write_text("")
    address = parse(f"influx+https://host:8086/base/?org=plant&bucket_prefix=hall1_&ca={ca}&also=/data/store&timeout_s=3", {})
    assert (address.kind, address.base, address.org) == ("influx", "https://host:8086/base", "plant")
    assert (address.bucket("cnc_raw"), address.ca, address.also, address.timeout_s) == (
        "hall1_cnc_raw", ca, Path("/data/store"), 3.0,
    )  # fmt: skip
    assert parse("victoriametrics+http://[::1]:8428", {}).base == "http://[::1]:8428"
    assert parse("influx1+http://host:8086", {}).token == ""


@pytest.mark.parametrize(
    ("url", "complaint"),
    [
        ("http://host", "use one of influx\\+http"),
        ("influx+http://host:8086", "names no organisation; add"),
        ("influx1+http://", "names no host"),
        ("influx1+http://user:hunter2@host", "no secrets in the URL"),
        ("influx+http://host?org=a&token=hunter2", "no secrets in the URL"),
        ("victoriametrics+http://host?db=x", "unknown option 'db'"),
        ("influx1+https://host?ca=/nowhere.pem", "there is no such file"),
        ("influx1+https://host?timeout_s=soon", "give 0.1 to 300"),
    ],
)
def test_a_url_that_cannot_be_used_says_why_without_its_secret(url: str, complaint: str) -> None:
    with pytest.raises(StoreError, match=complaint) as raised:
        parse(url, {})
    assert "hunter2" not in str(raised.value) and "\n" not in str(raised.value)


def test_the_token_comes_of_the_environment_or_a_file_and_shows_nowhere(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text(SECRET + "\n")
    given = parse("influx+http://host?org=o", {TOKEN: SECRET})
    assert given.token == parse("influx+http://host?org=o", {TOKEN_FILE: str(file)}).token == SECRET
    assert SECRET not in repr(given)
    with pytest.raises(StoreError, match="cannot be read"):
        parse("influx+http://host?org=o", {TOKEN_FILE: str(tmp_path / "none")})


@pytest.mark.parametrize("url", ["influx+http://{}?org=o", "influx1+http://{}", "victoriametrics+http://{}"])
def test_a_server_that_repeats_the_token_does_not_get_it_into_a_text_or_a_log(url: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    kinds: dict[str, type[Influx1 | Influx2 | Victoria]] = {"influx": Influx2, "influx1": Influx1, "victoriametrics": Victoria}
    with HttpServer().serving() as server:
        server.standing = Answer(401, f"no such token: {SECRET}")
        address = parse(url.format(f"127.0.0.1:{server.port}"), {TOKEN: SECRET})
        sink: Server = kinds[address.kind](address)
        with pytest.raises(ServerAwayError, match="is the token right") as raised:
            sink.write("cnc_raw", b"m v=1 1\n")
        reader = InfluxReader(address)
        with pytest.raises(StoreError, match="says 401") as asked:
            reader.machines()
        reader.close()
        sink.close()
        assert all(SECRET in request.headers["authorization"] for request in server.requests)
        assert all(SECRET not in str(request.query) for request in server.requests)
    told = str(raised.value) + str(asked.value) + caplog.text
    assert SECRET not in told


def test_a_user_of_influxdb_1_is_named_by_basic_authentication() -> None:
    with HttpServer().serving() as server:
        sink = Influx1(parse(f"influx1+http://127.0.0.1:{server.port}", {TOKEN: "cnctwin:hunter2"}))
        sink.write("cnc_raw", b"m v=1 1\n")
        sink.close()
        scheme, told = server.requests[0].headers["authorization"].split()
        assert scheme == "Basic" and base64.b64decode(told) == b"cnctwin:hunter2"


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with cert.pem, which signs itself, and its key.pem."""
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl to make a certificate")
    folder = tmp_path_factory.mktemp("tls")
    made = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2"]
    named = ["-keyout", "key.pem", "-out", "cert.pem", "-subj", "/CN=plant", "-addext", "subjectAltName=IP:127.0.0.1"]
    subprocess.run([*made, *named], cwd=folder, check=True, capture_output=True)
    return folder


@pytest.mark.parametrize("kind", ["influx", "influx1", "victoriametrics"])
def test_https_trusts_only_who_the_ca_signed(certificate: Path, kind: str) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate / "cert.pem", certificate / "key.pem")
    kinds: dict[str, type[Influx1 | Influx2 | Victoria]] = {"influx": Influx2, "influx1": Influx1, "victoriametrics": Victoria}
    org = "org=o&" if kind == "influx" else ""
    with HttpServer().serving(context) as server:
        where = f"{kind}+https://127.0.0.1:{server.port}?{org}"
        trusting = kinds[kind](parse(f"{where}ca={certificate / 'cert.pem'}", {TOKEN: SECRET}))
        trusting.write("cnc_raw", b"m v=1 1\n")
        trusting.close()
        assert server.lines() == ["m v=1 1"]
        doubting = kinds[kind](parse(where, {TOKEN: SECRET}))
        with pytest.raises(ServerAwayError, match=r"(?i)certificate"):
            doubting.write("cnc_raw", b"m v=1 1\n")
        doubting.close()
        assert len(server.requests) == 1, "the token was not sent to who is not trusted"


def test_a_ca_that_is_none_is_said(tmp_path: Path) -> None:
    (tmp_path / "no.pem").write_text("not a certificate")
    with pytest.raises(StoreError, match="look at the address and at ca="):
        open_influx(f"influx1+https://127.0.0.1:1?ca={tmp_path / 'no.pem'}", writable=False, spool=tmp_path)
