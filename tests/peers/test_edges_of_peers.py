"""Edge nodes of peers against our host application. Where a peer breaks the specification, pairings.toml says so, and the check
has to fail, so that the list stays true.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.peers.edge_checks import CHECKS
from tests.peers.edge_pairing import EdgePairing
from tests.peers.pairing import PATIENCE_S, Peer, broker_of, judge, pairs
from tests.peers.toolchain import command_of
from tests.wire.proxy import Proxy

pytestmark = pytest.mark.broker


@pytest.fixture(scope="module", params=pairs("edge"), ids=lambda pair: f"{pair[0]} on {pair[1]}")
def pairing(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[EdgePairing]:
    """One peer on one broker."""
    peer, broker_name = request.param
    command_of(peer.name)
    with broker_of(broker_name, tmp_path_factory) as broker, Proxy(upstream=broker.address) as proxy:
        it = EdgePairing(peer, broker, proxy)
        yield it
        it.close()


@pytest.mark.parametrize("check", CHECKS)
def test_our_host_and_an_edge_node_of_a_peer(pairing: EdgePairing, check: str) -> None:
    peer: Peer = pairing.peer
    if check in peer.lacks:
        return
    pairing.ready(PATIENCE_S)
    judge(peer, check, lambda patience_s: CHECKS[check](pairing, patience_s))
    if check in peer.faults:
        pairing.end()  # it may have left anything behind
