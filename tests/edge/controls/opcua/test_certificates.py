"""Our own certificate, and whom we trust."""

import stat
from pathlib import Path

import pytest

pytest.importorskip("asyncua")

from cryptography import x509
from cryptography.hazmat.primitives import serialization

from edge.controls.opcua.certificates import Identity, check_trust, fingerprint, leaf_of, own_identity
from edge.errors import ConfigError, ConnectionLostError

URL = "opc.tcp://mill:4840"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Identity:
    return own_identity(tmp_path_factory.mktemp("server"), name="control", is_server=True)


def test_our_certificate_is_made_once_and_its_key_is_the_owners_alone(tmp_path: Path) -> None:
    first = own_identity(tmp_path / "own")
    again = own_identity(tmp_path / "own")
    assert stat.S_IMODE(first.key.stat().st_mode) == 0o600
    assert stat.S_IMODE(first.key.parent.stat().st_mode) == 0o700
    assert first == again
    certificate = x509.load_der_x509_certificate(first.certificate.read_bytes())
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.UniformResourceIdentifier) == [first.uri]


def test_one_that_has_expired_is_made_anew(tmp_path: Path) -> None:
    old = own_identity(tmp_path, valid_days=-2).certificate.read_bytes()
    assert own_identity(tmp_path).certificate.read_bytes() != old


def test_a_server_that_nobody_vouched_for_is_refused_in_one_line_that_says_how_to_trust_it(
    server: Identity, tmp_path: Path
) -> None:
    der = server.certificate.read_bytes()
    with pytest.raises(ConnectionLostError, match="is not trusted yet; compare it with the control's") as refused:
        check_trust(URL, der, "", tmp_path)
    text = str(refused.value)
    assert "\n" not in text
    assert f"cnctwin edge discover '{URL}?server_fingerprint={fingerprint(der)}'" in text
    trusted = tmp_path / "trusted"
    trusted.mkdir()
    (tmp_path / "refused" / f"{fingerprint(der)}.der").rename(trusted / "mill.der")
    check_trust(URL, der, "", tmp_path)


def test_a_pinned_fingerprint_a_pem_or_a_der_file_is_trust(server: Identity, tmp_path: Path) -> None:
    der = server.certificate.read_bytes()
    check_trust(URL, der, fingerprint(der), tmp_path)
    trusted = tmp_path / "trusted"
    trusted.mkdir()
    (trusted / "junk.txt").write_text("no certificate")
    pem = x509.load_der_x509_certificate(der).public_bytes(serialization.Encoding.PEM)
    (trusted / "mill.pem").write_bytes(pem)
    check_trust(URL, der, "", tmp_path)


def test_another_certificate_than_the_pinned_one_is_refused(server: Identity, tmp_path: Path) -> None:
    with pytest.raises(ConnectionLostError, match=r"has fingerprint [0-9a-f]{64}, not the abababababababab… of opcua"):
        check_trust(URL, server.certificate.read_bytes(), "ab" * 32, tmp_path)


def test_an_expired_certificate_is_refused_though_it_is_pinned(tmp_path: Path) -> None:
    der = own_identity(tmp_path, name="old", valid_days=-2, is_server=True).certificate.read_bytes()
    with pytest.raises(ConnectionLostError, match=r"expired on \d{4}-\d\d-\d\d; renew it at the control"):
        check_trust(URL, der, fingerprint(der), tmp_path)


def test_junk_in_place_of_a_certificate_is_no_certificate(tmp_path: Path) -> None:
    with pytest.raises(ConnectionLostError, match="no certificate that can be read"):
        check_trust(URL, b"\x30\x82junk", "", tmp_path)


def test_of_a_chain_the_first_one_counts(server: Identity) -> None:
    der = server.certificate.read_bytes()
    assert leaf_of(der + der) == der
    assert leaf_of(b"") == b""


def test_a_folder_that_takes_nothing_is_named_with_the_way_out(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match=r"no certificate can be kept there: .*; set opcua\.certificate_folder"):
        own_identity(tmp_path / "file" / "below")
