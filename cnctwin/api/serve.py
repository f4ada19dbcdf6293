"""`cnctwin serve`: the page and the runtime interface of a plant, over its broker and its store."""

import logging
import os
import webbrowser
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any

from cnctwin.errors import UsageError
from cnctwin.processes.state_file import STATE_S, keep
from edge.state_dir import state_dir
from sparkplug.broker import BrokerAddress

TOKEN_VARIABLE = "CNCTWIN_PAGE_TOKEN"  # noqa: S105  the name of the variable, not a secret
DEFAULT_PORT = 8080
EXTRA = "pip install 'cnctwin[page]' brings it"


@dataclass(frozen=True, slots=True)
class ServeOptions:
    """The options of the command. `store` '' = none, `port` 0 = a free one."""

    group: str = "cnc"
    store: str = ""
    config: Path | None = None
    models: Path | None = None
    diagnoses: Path | None = None
    jobs: Path | None = None
    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    token_file: Path | None = None
    users: Path | None = None
    audit: Path | None = None
    registry: Path | None = None
    sealed: Path | None = None
    proxy_header: str | None = None
    proxy: str | None = None
    allow_hosts: tuple[str, ...] = ()
    state_file: Path | None = None
    no_open: bool = False


def serve(options: ServeOptions, broker: BrokerAddress, stop: Event) -> None:
    """Serve until stopped. Raises UsageError for what must not be (an open address without a token) or cannot be."""
    try:
        from cnctwin.api.application import create_app  # noqa: PLC0415  with the extra that it needs
        from cnctwin.api.live.plant import LivePlant  # noqa: PLC0415
        from cnctwin.api.live.viewer import Viewer  # noqa: PLC0415
        from cnctwin.api.server import Server  # noqa: PLC0415
        from cnctwin.api.sources import Sources  # noqa: PLC0415
    except ModuleNotFoundError as missing:
        raise UsageError(f"the page needs the package {missing.name}; {EXTRA}") from None
    from cnctwin.api.constants import Constants  # noqa: PLC0415
    from cnctwin.api.door.audit import AuditLog  # noqa: PLC0415
    from cnctwin.api.envelope import Envelope  # noqa: PLC0415
    from cnctwin.api.nights import Nights  # noqa: PLC0415
    from cnctwin.api.residual import Models  # noqa: PLC0415
    from cnctwin.api.store_reader import StoreReader  # noqa: PLC0415
    from processors.running.limits import limits_of  # noqa: PLC0415

    access = access_of(options, os.environ.get(TOKEN_VARIABLE))
    live = LivePlant()
    viewer = Viewer(broker, options.group, live, limits_of(options.config))
    constants = Constants(options.config, viewer.descriptions.of)
    store = StoreReader(options.store)
    audit = AuditLog(options.audit or state_dir() / "audit" / "page.jsonl")
    told = (options.diagnoses, Nights(), options.jobs, access, audit, options.registry, Envelope(options.sealed))
    sources = Sources(live, viewer, store, constants, Models(options.models), *told)
    app = create_app(sources)
    server = Server(app, options.host, options.port)
    logging.getLogger("sparkplug").setLevel(logging.ERROR)  # what is wrong with the connection stands in /health
    viewer.start()
    try:
        with server:
            print(f"{server.url} shows the plant of {broker.url}; Ctrl-C ends it", flush=True)
            if not options.no_open:
                webbrowser.open(server.url)
            state: dict[str, Any] = {"url": server.url, "port": server.port, "pid": os.getpid()}
            while server.alive and viewer.alive and not stop.is_set():
                keep(options.state_file, {**state, "broker": viewer.online, "machines": len(live.machines())})
                stop.wait(STATE_S)
    finally:
        viewer.stop()
        store.close()
    if not stop.is_set():
        raise UsageError(f"the server on {options.host}:{server.port} ended by itself; the lines before say why")


def access_of(options: ServeOptions, variable: str | None) -> Any:
    """Return who may ask, by the options. Raises UsageError where they would leave the plant open to a network."""
    from cnctwin.api.access import Access, is_loopback  # noqa: PLC0415
    from cnctwin.api.door.users import TOKEN_CHARACTERS_MIN, private_text, read_users  # noqa: PLC0415

    token = variable if options.token_file is None else private_text(options.token_file, "--token-file")
    if token is not None and len(token) < TOKEN_CHARACTERS_MIN:
        where = TOKEN_VARIABLE if options.token_file is None else str(options.token_file)
        raise UsageError(
            f"the token of {where} is shorter than {TOKEN_CHARACTERS_MIN} characters; make one: openssl rand -hex 24"
        )
    if (options.proxy_header is None) != (options.proxy is None):
        raise UsageError("--proxy-header and --proxy go together: the header that names the user, and the proxy's address")
    if options.proxy is not None and not _is_address(options.proxy):
        raise UsageError(f"--proxy {options.proxy} is no address; name the one that the proxy connects from, as 10.0.0.5")
    users = () if options.users is None else read_users(options.users)
    hosts = frozenset(name.lower() for name in (*options.allow_hosts, options.host))
    access = Access(token, options.proxy_header, options.proxy, hosts, users)
    if options.users is not None and not access.has_tokens and options.proxy_header is None:
        raise UsageError(
            f"--users {options.users}: none of these users has a token; give each one a token, or name a proxy "
            "(--proxy-header and --proxy)"
        )
    if not is_loopback(options.host) and not access.has_tokens and options.proxy_header is None:
        raise UsageError(
            f"--host {options.host} is open to the network; give a token ({TOKEN_VARIABLE}, --token-file or --users), "
            "or a reverse proxy (--proxy-header and --proxy)"
        )
    return access


def _is_address(text: str) -> bool:
    from cnctwin.api.access import same_address  # noqa: PLC0415

    return same_address(text, text)
