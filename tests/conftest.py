"""What tests of several packages share: a real broker, and the proxy in front of it."""

from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests.wire.mosquitto import Mosquitto, find_mosquitto
from tests.wire.proxy import Proxy

# How long an example takes says more of the machine that it runs on than of the code.
settings.register_profile("house", deadline=None)
settings.load_profile("house")


@pytest.fixture(scope="session", autouse=True)
def state_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What commands keep over restarts goes into a folder of this run, not into the user's home."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CNCTWIN_STATE_DIR", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session")
def mosquitto_program() -> str:
    """The path of Mosquitto; the test is skipped where there is none."""
    found = find_mosquitto()
    if found is None:
        pytest.skip("no mosquitto on this machine; install the package mosquitto")
    return found


@pytest.fixture
def mosquitto(mosquitto_program: str) -> Iterator[Mosquitto]:
    """A real Mosquitto on a free loopback port, without limits that would drop messages silently."""
    with Mosquitto() as broker:
        yield broker


@pytest.fixture
def proxy(mosquitto: Mosquitto) -> Iterator[Proxy]:
    """A recording, fault-injecting proxy in front of that broker."""
    with Proxy(upstream=mosquitto.address) as between:
        yield between
