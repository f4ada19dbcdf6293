"""The parts an application stands on. Each but the live plant may be missing; /health says which, and what to do."""

from dataclasses import dataclass, field
from pathlib import Path

from cnctwin.api.access import Access
from cnctwin.api.constants import Constants
from cnctwin.api.door.audit import AuditLog
from cnctwin.api.envelope import Envelope
from cnctwin.api.live.plant import LivePlant
from cnctwin.api.live.viewer import Viewer
from cnctwin.api.nights import Nights
from cnctwin.api.residual import Models
from cnctwin.api.store_reader import StoreReader


@dataclass(frozen=True, slots=True)
class Sources:
    """The live plant, and beside it what the command was given.

    viewer: feeds the live plant from a broker; None where somebody else does
    store: answers questions about the past
    constants: of the machines, for predictions
    models: the residual models, for predictions
    diagnoses: the folder with one folder for each machine, as `cnctwin gap diagnose` writes it
    nights: in which the twin was judged
    jobs: the batch consumer's folder, for the files of results
    access: who may ask
    audit: the record of who did what
    registry: the folder of models that `cnctwin model` keeps
    envelope: the effect that the demo hides in its machine
    """

    live: LivePlant
    viewer: Viewer | None = None
    store: StoreReader = field(default_factory=StoreReader)
    constants: Constants = field(default_factory=Constants)
    models: Models = field(default_factory=lambda: Models(None))
    diagnoses: Path | None = None
    nights: Nights = field(default_factory=Nights)
    jobs: Path | None = None
    access: Access = field(default_factory=Access)
    audit: AuditLog = field(default_factory=AuditLog)
    registry: Path | None = None
    envelope: Envelope = field(default_factory=lambda: Envelope(None))
