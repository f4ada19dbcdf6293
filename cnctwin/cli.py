"""The command `cnctwin`.

Exit codes: 0 = done, 1 = the answer is bad news, 2 = wrong input. Errors are one line on stderr that names the culprit, the value
and the way out.
"""

import logging
import sys
from typing import NoReturn

import typer
from typer.exceptions import TyperException

from cnctwin.commands.alerts import alerts_app
from cnctwin.commands.bridge import bridge
from cnctwin.commands.demo import demo
from cnctwin.commands.doctor import doctor
from cnctwin.commands.edge import edge_app
from cnctwin.commands.expect import expect
from cnctwin.commands.gap import gap_app
from cnctwin.commands.identify import identify
from cnctwin.commands.import_recording import import_recording
from cnctwin.commands.jobs import jobs_app
from cnctwin.commands.model import model_app
from cnctwin.commands.optimise import optimise
from cnctwin.commands.parts import parts_app
from cnctwin.commands.plan import plan_app
from cnctwin.commands.process import process
from cnctwin.commands.record import record
from cnctwin.commands.replay import replay_history
from cnctwin.commands.serve import serve
from cnctwin.commands.simulate import simulate
from cnctwin.commands.simulate_control import control_app
from cnctwin.commands.store import store_app
from cnctwin.commands.train.app import train_app
from cnctwin.commands.train.detector import train_detector
from cnctwin.commands.train.residual import train_residual
from cnctwin.commands.twin import twin_app
from cnctwin.commands.validate import validate
from cnctwin.commands.watch import watch
from cnctwin.errors import ApplicationError, BrokerStartError
from cnctwin.files.modes import restrict
from edge.errors import EdgeError
from processors.errors import ProcessorError
from sparkplug.errors import SparkplugError
from twin.errors import TwinError

app = typer.Typer(
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, help="A digital twin of CNC machines."
)
app.add_typer(edge_app, name="edge")
app.add_typer(gap_app, name="gap")
app.add_typer(control_app, name="simulate-control")
app.add_typer(alerts_app, name="alerts")
app.add_typer(train_app, name="train")
app.add_typer(store_app, name="store")
app.add_typer(parts_app, name="parts")
app.add_typer(jobs_app, name="jobs")
app.add_typer(plan_app, name="plan")
app.add_typer(twin_app, name="twin")
train_app.command("detector")(train_detector)
train_app.command("residual")(train_residual)
app.add_typer(model_app, name="model")
app.command()(demo)
app.command()(watch)
app.command()(doctor)
app.command()(process)
app.command()(bridge)
app.command()(simulate)
app.command()(expect)
app.command()(identify)
app.command("import")(import_recording)
app.command()(record)
app.command()(serve)
app.command()(optimise)
app.command("replay")(replay_history)
app.command()(validate)


def main() -> None:
    """Run the command; every expected error is one line on stderr."""
    restrict(sys.argv[1:])
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(levelname)s %(message)s")
    try:
        # Standalone, typer would report a wrong option in a box of several lines.
        code = app(standalone_mode=False)
    except TyperException as error:
        _explain(error)
    except BrokerStartError as error:
        _fail(error, 1)
    except (ApplicationError, EdgeError, ProcessorError, SparkplugError, TwinError) as error:
        _fail(error, 2)
    raise SystemExit(code)


def _explain(error: TyperException) -> NoReturn:
    message = error.format_message()
    if not message:  # A command without arguments: its help has been shown already.
        raise SystemExit(2)
    context = getattr(error, "ctx", None)
    _fail(f"{message.rstrip('.')}; see {'cnctwin' if context is None else context.command_path} --help", 2)


def _fail(error: object, code: int) -> NoReturn:
    print(f"cnctwin: {error}", file=sys.stderr)
    raise SystemExit(code)
