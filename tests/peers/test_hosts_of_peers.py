"""Host applications of peers against our edge node; see test_edges_of_peers.py."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.peers.host_checks import CHECKS
from tests.peers.host_pairing import HostPairing
from tests.peers.pairing import PATIENCE_S, Peer, broker_of, judge, pairs
from tests.peers.toolchain import command_of
from tests.wire.proxy import Proxy

pytestmark = pytest.mark.broker


@pytest.fixture(scope="module", params=pairs("host"), ids=lambda pair: f"{pair[0]} on {pair[1]}")
def pairing(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[HostPairing]:
    """One peer on one broker."""
    peer, broker_name = request.param
    command_of(peer.name)
    with (
        broker_of(broker_name, tmp_path_factory) as broker,
        Proxy(upstream=broker.address) as theirs,
        Proxy(upstream=broker.address) as ours,
    ):
        it = HostPairing(peer, broker, theirs, ours)
        yield it
        it.close()


@pytest.mark.parametrize("check", CHECKS)
def test_a_host_application_of_a_peer_and_our_edge(pairing: HostPairing, check: str) -> None:
    peer: Peer = pairing.peer
    if check in peer.lacks:
        return
    pairing.ready(PATIENCE_S)
    judge(peer, check, lambda patience_s: CHECKS[check](pairing, patience_s))
    if check in peer.faults:
        pairing.end()  # it may have left anything behind
