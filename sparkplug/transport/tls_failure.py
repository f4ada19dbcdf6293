"""Why TLS failed, in a line that says whose paper is wrong and what to do about it.

What a broker thinks of our certificate it says in an alert (RFC 8446, 6.2), with TLS 1.3 only after our side of the handshake is
done: it comes with the first read. What we think of the broker's certificate OpenSSL says by a number (X509_V_ERR_…).
"""

import ssl

from sparkplug.broker import BrokerAddress

_OF_US = {
    "CERTIFICATE_EXPIRED": "has expired; make a new one",
    "CERTIFICATE_REVOKED": "is revoked; make a new one",
    "BAD_CERTIFICATE": "is not valid, or not valid yet; compare its dates with the clock of the broker",
    "UNKNOWN_CA": "comes from an authority that it does not know; take one from the authority in the broker's cafile",
    "UNSUPPORTED_CERTIFICATE": "is not made for clients; make one with: certificates client",
    "CERTIFICATE_UNKNOWN": "cannot be used",
}
_OF_THE_BROKER = {
    9: "is not valid yet; compare its dates with the clock of this machine",
    10: "has expired; give the broker a new one",
    18: "comes from an authority that we do not know; ca_file has to be that of the broker",
    19: "comes from an authority that we do not know; ca_file has to be that of the broker",
    20: "comes from an authority that we do not know; ca_file has to be that of the broker",
    26: "is not made for servers: a client may be posing as the broker",
    62: "is made out to other names than {host}; connect by one of them, or make one with --host {host}",
    64: "is made out to other addresses than {host}; connect by one of them, or make one with --host {host}",
}


def explained(error: OSError, broker: BrokerAddress) -> str:
    """The line for this error; what is none of TLS as it is.

    >>> explained(ConnectionRefusedError(111, "Connection refused"), BrokerAddress())
    '[Errno 111] Connection refused'
    """
    reason = getattr(error, "reason", None)
    if not isinstance(error, ssl.SSLError) or not isinstance(reason, str):
        return str(error)
    if isinstance(error, ssl.SSLCertVerificationError):
        wrong = _OF_THE_BROKER.get(error.verify_code, f"is refused: {error.verify_message}")
        return f"the certificate of the broker {wrong.format(host=broker.host)}"
    if reason == "KEY_VALUES_MISMATCH":
        return f"key_file {broker.key_file} does not belong to certificate_file {broker.certificate_file}"
    if reason == "WRONG_VERSION_NUMBER":
        return f"port {broker.port} of the broker speaks no TLS; is it the port for mqtt://?"
    said = reason.partition("_ALERT_")[2]
    if said == "CERTIFICATE_REQUIRED" or (said == "HANDSHAKE_FAILURE" and broker.certificate_file is None):
        return "the broker wants a certificate of us; give certificate_file and key_file"
    if said in _OF_US:
        return f"the broker says that our certificate {broker.certificate_file} {_OF_US[said]}"
    return str(error)
