"""`cnctwin serve` on the command line; `cnctwin/api/serve.py` does it, and is imported when it is run."""

from pathlib import Path
from typing import Annotated

import typer

from cnctwin.commands.options import Broker, Config, Group, StateFile, StorePlace
from cnctwin.processes.given_broker import address, broker_or_own
from cnctwin.processes.stopping import stopped_by_signals


def serve(
    broker: Broker = None,
    group: Group = "cnc",
    store: StorePlace = None,
    config: Config = None,
    models: Annotated[Path | None, typer.Option(help="Folder of the models")] = None,
    diagnoses: Annotated[
        Path | None, typer.Option(help="Folder with <machine>/diagnosis.json; else that of the loop (twin run)")
    ] = None,
    jobs: Annotated[
        Path | None, typer.Option(help="Folder of jobs and results of `cnctwin jobs run`; its files are offered")
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen on; another than loopback needs a token or a proxy")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port; 0 = a free one", min=0, max=65535)] = 8080,
    token_file: Annotated[Path | None, typer.Option(help="File of mode 600 with the token; else $CNCTWIN_PAGE_TOKEN")] = None,
    users: Annotated[
        Path | None, typer.Option(help="File of mode 600 with users, their roles and tokens (docs/reference/api.md)")
    ] = None,
    audit: Annotated[
        Path | None,
        typer.Option(help="The record of who did what; else audit/page.jsonl in the state folder", show_default=False),
    ] = None,
    registry: Annotated[
        Path | None, typer.Option(help="Folder that `cnctwin model` keeps, for administrators to promote")
    ] = None,
    sealed: Annotated[
        Path | None, typer.Option(help="File in which the simulated machine has sealed its hidden effect", hidden=True)
    ] = None,
    proxy_header: Annotated[str | None, typer.Option(help="Header in which the reverse proxy names the user")] = None,
    proxy: Annotated[str | None, typer.Option(help="Address that the proxy connects from")] = None,
    allow_host: Annotated[list[str] | None, typer.Option(help="One more host name by which clients reach this server")] = None,
    state_file: StateFile = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the page in a browser")] = False,
) -> None:
    """The page and the runtime interface: state, predictions, history, gaps and alerts over HTTP."""
    from cnctwin.api.serve import ServeOptions
    from cnctwin.api.serve import serve as run_server
    from cnctwin.machines.place import diagnoses_folder, machines_folder
    from cnctwin.memory.store.opening import default_place

    options = ServeOptions(
        group=group,
        store=store or str(default_place()),
        config=config,
        models=models,
        diagnoses=diagnoses or diagnoses_folder(machines_folder(None, config)),
        jobs=jobs,
        host=host,
        port=port,
        token_file=token_file,
        users=users,
        audit=audit,
        registry=registry,
        sealed=sealed,
        proxy_header=proxy_header,
        proxy=proxy,
        allow_hosts=tuple(allow_host or ()),
        state_file=state_file,
        no_open=no_open,
    )
    with stopped_by_signals() as stop, broker_or_own(address(broker)) as where:
        run_server(options, where, stop)
