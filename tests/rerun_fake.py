"""The part of rerun-sdk that navirl uses, as a module that notes what is logged."""

import types
from pathlib import Path
from types import SimpleNamespace


def fake_rerun():
    """A module in place of rerun; `streams` lists what each recording was told."""
    module = types.ModuleType("rerun")
    module.streams = []

    class RecordingStream:
        def __init__(self, name):
            self.name, self.path, self.open = name, None, True
            self.time_ns, self.logged, self.spawned = None, [], False
            module.streams.append(self)

        def spawn(self):
            self.spawned = True

        def save(self, path):
            self.path = path

        def set_time(self, timeline, *, timestamp):
            self.timeline, self.time_ns = timeline, int(timestamp.astype("datetime64[ns]").astype(int))

        def log(self, entity, what, *, static=False):
            self.logged.append((entity, None if static else self.time_ns, what))

        def disconnect(self):
            self.open = False
            if self.path is not None:
                Path(self.path).write_text("RRF2", encoding="utf-8")

    module.RecordingStream = RecordingStream
    module.ViewCoordinates = SimpleNamespace(RIGHT_HAND_Z_UP="z up")
    for kind, fields in {
        "Mesh3D": ("vertex_positions", "triangle_indices", "vertex_colors"),
        "LineStrips3D": ("strips", "colors", "radii"),
        "Points3D": ("positions", "colors", "radii"),
        "Arrows3D": ("origins", "vectors", "colors"),
        "Scalars": ("scalars",),
    }.items():
        setattr(module, kind, _archetype(kind, fields))
    return module


def _archetype(kind, fields):
    def made(*places, **named):
        given = {**dict(zip(fields, places, strict=False)), **named}
        assert set(given) <= set(fields), (kind, given.keys())
        return SimpleNamespace(kind=kind, **given)

    return made
