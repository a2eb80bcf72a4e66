"""The first messages of a recording: whose clock stamps them, and how its frames connect."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.logs.container.batches import Channel
from navirl_cli.logs.container.compressed import Opened
from navirl_cli.logs.container.log_file import LogFile
from navirl_cli.logs.messages.decode import Decoder, Part
from navirl_cli.logs.messages.schema import Schema, SchemaError, full_name, parse_definition
from navirl_cli.logs.roles import message_types
from navirl_cli.logs.roles.clocks import Stamped
from navirl_cli.logs.tf.transforms import Link, links_of
from navirl_cli.logs.tf.tree import TransformTree

#: Chunks in whose messages stamps are looked for.
_SAMPLED = 8
_STAMP = "header.stamp"
_TF_STAMP = message_types.TF.fields[_STAMP]


@dataclass(frozen=True)
class Sample:
    """What the first messages tell."""

    #: Stamps by topic; of transforms those of each message's first.
    stamped: dict[str, Stamped]
    #: How the frames connect, "map -> odom -> base_link"; empty without tf.
    frames: str


def first_messages(files: Sequence[Opened]) -> Sample:
    """Look at the messages of the first chunks.

    Args:
        files: Of the recording.
    """
    decoders: dict[Channel, Decoder | None] = {}
    parts: dict[str, list[Part]] = {}

    def wanted(channel: Channel) -> bool:
        if channel not in decoders:
            decoders[channel] = _decoder(channel)
        return decoders[channel] is not None

    with LogFile(files[0]) as log:
        for number, batch in enumerate(log.batches(wanted)):
            # without a summary, channels become known on the way
            if number >= _SAMPLED * len(log.channels):
                break
            decoder = decoders[batch.channel]
            if decoder is not None:
                part = decoder.decode(batch)
                if len(part.order):
                    parts.setdefault(batch.channel.topic, []).append(part)
    static: list[Link] = []
    moving: list[Link] = []
    for topic, some in parts.items():
        if _TF_STAMP in some[0].columns:
            (static if topic.endswith("tf_static") else moving).extend(
                link for part in some for link in links_of(part.columns, part.counts[message_types.TF.sequence or ""])
            )
    stamped = {topic: one for topic, some in parts.items() if (one := _stamped(topic, some)) is not None}
    return Sample(stamped, TransformTree(static, moving).describe() if static or moving else "")


def _decoder(channel: Channel) -> Decoder | None:
    """A decoder of a channel's stamps, or of all of its transforms; None where it has none or cannot be decoded."""
    tf = full_name(channel.schema_name) == message_types.TF.type_name
    paths = tuple(message_types.TF.fields.values()) if tf else (_STAMP,)
    try:
        schema = parse_definition(
            channel.schema_name, channel.schema_encoding, channel.schema_text, channel.message_encoding
        )
        leaves = [schema.leaf(path) for path in paths]
    except SchemaError:
        return None
    return Decoder(schema, paths) if isinstance(schema, Schema) and leaves[0].kind == "time" else None


def _stamped(topic: str, parts: Sequence[Part]) -> Stamped | None:
    """The stamps of a topic's first messages."""
    logs, stamps = [], []
    for part in parts:
        if _STAMP in part.columns:
            logs.append(part.log_time_ns)
            stamps.append(part.columns[_STAMP])
        else:
            counts = part.counts[message_types.TF.sequence or ""]
            some = counts > 0
            logs.append(part.log_time_ns[some])
            stamps.append(part.columns[_TF_STAMP][(np.cumsum(counts) - counts)[some]])
    log_ns, stamp_ns = np.concatenate(logs), np.concatenate(stamps)
    rows = np.argsort(log_ns, kind="stable")
    return Stamped(topic, log_ns[rows], stamp_ns[rows]) if rows.size else None
