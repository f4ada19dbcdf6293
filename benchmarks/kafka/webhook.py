"""The receiver of notifications: an HTTP server of the run that notes each one that comes, in order."""

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import NamedTuple

from processors.alerts.courier.webhook import ID_HEADER


class Received(NamedTuple):
    """A notification that came: its id, of each alert in it fingerprint, beginning and status, and how many it does not show."""

    id: str
    alerts: tuple[tuple[str, str, str], ...]
    left_out: int = 0


class Webhook:
    """See the module."""

    def __init__(self) -> None:
        self.received: list[Received] = []
        lock, received = threading.Lock(), self.received

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                alerts = tuple((one["fingerprint"], one["startsAt"], one["status"]) for one in body["alerts"])
                with lock:
                    received.append(Received(self.headers[ID_HEADER], alerts, body["truncatedAlerts"]))
                self.send_response(200)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """The address at which it listens."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/"

    def stop(self) -> None:
        """Close it."""
        self._server.shutdown()
        self._server.server_close()
