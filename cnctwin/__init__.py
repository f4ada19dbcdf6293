"""cnctwin: a digital twin of CNC machines; in Python a store, run logs, simulation, diagnosis, optimisation and live rows.

`import cnctwin` loads nothing but this file; each name below is loaded, with what it needs, when it is first asked for (PEP 562).
The interface and what of it is stable: docs/reference/python.md. All else in this package is the program: commands
over services, over what is kept and what stands in; the ground is files, terminal and processes.
"""

TYPE_CHECKING = False  # as type checkers read it; `typing` would take longer to load than this file
if TYPE_CHECKING:
    from cnctwin.errors import ApplicationError as ApplicationError
    from cnctwin.errors import MissingPackageError as MissingPackageError
    from cnctwin.errors import UsageError as UsageError
    from cnctwin.interface.diagnosis import Diagnosis as Diagnosis
    from cnctwin.interface.diagnosis import diagnose as diagnose
    from cnctwin.interface.errors import BrokerError as BrokerError
    from cnctwin.interface.errors import CaseError as CaseError
    from cnctwin.interface.errors import LimitsError as LimitsError
    from cnctwin.interface.errors import MachineError as MachineError
    from cnctwin.interface.errors import ProgramError as ProgramError
    from cnctwin.interface.errors import RunError as RunError
    from cnctwin.interface.machine import read_machine as read_machine
    from cnctwin.interface.optimisation import Optimised as Optimised
    from cnctwin.interface.optimisation import optimise as optimise
    from cnctwin.interface.row import Row as Row
    from cnctwin.interface.row import Signal as Signal
    from cnctwin.interface.run import Run as Run
    from cnctwin.interface.run import read_run as read_run
    from cnctwin.interface.run import write_run as write_run
    from cnctwin.interface.simulation import Simulated as Simulated
    from cnctwin.interface.simulation import simulate as simulate
    from cnctwin.interface.store import Store as Store
    from cnctwin.interface.store import StoredSignal as StoredSignal
    from cnctwin.interface.store import open_store as open_store
    from cnctwin.interface.watching import Watch as Watch
    from cnctwin.interface.watching import watch as watch
    from cnctwin.memory.store.contract import StoreError as StoreError
    from twin.machine import MachineFile as MachineFile

_PLACES = {
    "cnctwin.errors": ("ApplicationError", "MissingPackageError", "UsageError"),
    "cnctwin.interface.diagnosis": ("Diagnosis", "diagnose"),
    "cnctwin.interface.errors": ("BrokerError", "CaseError", "LimitsError", "MachineError", "ProgramError", "RunError"),
    "cnctwin.interface.machine": ("read_machine",),
    "cnctwin.interface.optimisation": ("Optimised", "optimise"),
    "cnctwin.interface.row": ("Row", "Signal"),
    "cnctwin.interface.run": ("Run", "read_run", "write_run"),
    "cnctwin.interface.simulation": ("Simulated", "simulate"),
    "cnctwin.interface.store": ("Store", "StoredSignal", "open_store"),
    "cnctwin.interface.watching": ("Watch", "watch"),
    "cnctwin.memory.store.contract": ("StoreError",),
    "twin.machine": ("MachineFile",),
}
"""The public names by the module that holds them; a test compares them with what type checkers see above."""
_PLACE_OF = {name: place for place, names in _PLACES.items() for name in names}

__all__ = [
    "ApplicationError",
    "BrokerError",
    "CaseError",
    "Diagnosis",
    "LimitsError",
    "MachineError",
    "MachineFile",
    "MissingPackageError",
    "Optimised",
    "ProgramError",
    "Row",
    "Run",
    "RunError",
    "Signal",
    "Simulated",
    "Store",
    "StoreError",
    "StoredSignal",
    "UsageError",
    "Watch",
    "diagnose",
    "open_store",
    "optimise",
    "read_machine",
    "read_run",
    "simulate",
    "watch",
    "write_run",
]


if not TYPE_CHECKING:  # who would otherwise believe every name

    def __getattr__(name: str) -> object:
        """Load a public name. Raises MissingPackageError where what it needs is not installed."""
        place = _PLACE_OF.get(name)
        if place is None:
            raise AttributeError(f"module 'cnctwin' has no attribute {name!r}")
        from importlib import import_module  # noqa: PLC0415

        from cnctwin.processes.extras import needed_by  # noqa: PLC0415

        with needed_by(f"cnctwin.{name}", "notebook"):
            found = getattr(import_module(place), name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
