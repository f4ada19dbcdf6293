"""Folders such as a trainer writes: a manifest and arrays, told apart by their seed."""

import hashlib
import json
from pathlib import Path


def made_model(folder: Path, seed: int = 1, **more: object) -> Path:
    """A residual model's folder as far as the registry looks at it."""
    folder.mkdir(parents=True)
    arrays = f"arrays of {seed}".encode()
    (folder / "arrays.npz").write_bytes(arrays)
    manifest = {
        "kind": "cnctwin residual model",
        "version": 1,
        "features": ["spindle_rpm~600", "ambient_temp_c"],
        "seed": seed,
        "trained": {"machine": "vmc", "from": "2026-11-01T00:00:00Z", "to": "2026-11-10T00:00:00Z", "data_sha256": "d" * 64},
        "held_out": {"hours": 48.0, "gain": {"value": 0.41, "low": 0.3, "high": 0.5}},
        "arrays_sha256": hashlib.sha256(arrays).hexdigest(),
        **more,
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder
