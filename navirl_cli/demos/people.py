"""Where the people are during a trial: tracks are joined, false ones left out, and one place represents each person."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import PersonTrack
from navirl_cli.logs.recording import Recording

#: A person who moves less than this stands still, m; beyond the second distance the mean place describes them badly.
STILL_M, WIDE_M = 0.05, 0.3
#: A track seen in a smaller share of the seconds with messages about people is false.
FALSE_SHARE = 0.2
#: A track that begins this near to where another ended continues it, m.
NEAR_M = 0.5
#: No person walks faster, m/s: a track that leaps has passed from one person to another.
FASTEST_M_S = 3.0


@dataclass(frozen=True, eq=False)
class People:
    """The people of a trial."""

    #: (p, 2) m, map frame: mean places over the trial.
    people_m: FloatArray
    #: One for each person, empty for those who stand still; no tracks where all stand still.
    tracks: tuple[PersonTrack, ...] = ()
    #: What a reader of the results should know, in words.
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Piece:
    """A part of a track without leaps."""

    name: str
    t_ns: IntArray
    xy_m: FloatArray


def people_during(recording: Recording, start_ns: int, stop_ns: int) -> People:
    """The people of a trial, from a log's messages.

    Trackers lose people and give them new numbers, and messages without names identify people by their place in a list.
    So tracks are cut where they leap, and joined where one begins near the place at which another ended. Without a
    message in the trial the last one before it holds, as for latched topics, else the first one after it.

    Args:
        recording: Tracks in the map's frame.
        start_ns: First instant of the trial.
        stop_ns: Last instant of the trial.
    """
    if len(recording.people_t_ns) == 0:
        return People(np.zeros((0, 2)))
    first, stop = _messages(recording.people_t_ns, start_ns, stop_ns)
    begin, end = (int(recording.people_t_ns[row]) for row in (first, stop - 1))
    pieces = [piece for number, _ in enumerate(recording.people) for piece in _pieces(recording, number, begin, end)]
    everyone = _joined(pieces)
    reported = len(_seconds(recording.people_t_ns[first:stop], begin))
    seconds = [len(_seconds(np.concatenate([piece.t_ns for piece in person]), begin)) for person in everyone]
    seen = [person for person, count in zip(everyone, seconds, strict=True) if count >= FALSE_SHARE * reported]
    false = [person[0].name for person, count in zip(everyone, seconds, strict=True) if count < FALSE_SHARE * reported]
    tracks = [_track(person, start_ns) for person in seen]
    notes = [note for person, track in zip(seen, tracks, strict=True) for note in _notes(person, track)]
    if false:
        notes.append(f"left out, because seen in less than {FALSE_SHARE:.0%} of the time: person {', '.join(false)}")
    return People(np.array([track.mean_m for track in tracks]).reshape(-1, 2), _moving(tracks), tuple(notes))


def _messages(t_ns: IntArray, start_ns: int, stop_ns: int) -> tuple[int, int]:
    """First and one past the last of the messages that hold for a trial."""
    first, stop = int(np.searchsorted(t_ns, start_ns)), int(np.searchsorted(t_ns, stop_ns, side="right"))
    return (first, stop) if stop > first else (max(first - 1, 0), max(first, 1))


def _seconds(t_ns: IntArray, since_ns: int) -> IntArray:
    """The seconds, counted from a time, that contain some of the times."""
    return np.unique((t_ns - since_ns) // 1_000_000_000)


def _pieces(recording: Recording, number: int, begin_ns: int, end_ns: int) -> list[_Piece]:
    """One track within a time, cut where it leaps."""
    track = recording.people[number]
    inside = (track.t_ns >= begin_ns) & (track.t_ns <= end_ns)
    t_ns, xy = track.t_ns[inside], track.xy_m[inside]
    moved = np.hypot(*np.diff(xy, axis=0).T)
    leaps = np.flatnonzero(moved > NEAR_M + FASTEST_M_S * np.diff(t_ns) / 1e9) + 1
    cut = zip(np.split(t_ns, leaps), np.split(xy, leaps), strict=True)
    return [_Piece(track.name, times, places) for times, places in cut if len(times)]


def _joined(pieces: list[_Piece]) -> list[list[_Piece]]:
    """Pieces by person: each continues the nearest one that ended before it began, if that is near."""
    everyone: list[list[_Piece]] = []
    for piece in sorted(pieces, key=lambda piece: int(piece.t_ns[0])):
        ended = [person for person in everyone if person[-1].t_ns[-1] < piece.t_ns[0]]
        away = [float(np.hypot(*(person[-1].xy_m[-1] - piece.xy_m[0]))) for person in ended]
        if away and min(away) <= NEAR_M:
            ended[int(np.argmin(away))].append(piece)
        else:
            everyone.append([piece])
    return everyone


def _track(person: list[_Piece], start_ns: int) -> PersonTrack:
    """A person's pieces as one track."""
    times = (np.concatenate([piece.t_ns for piece in person]) - start_ns) / 1e9
    return PersonTrack(person[0].name, times, np.concatenate([piece.xy_m for piece in person]))


def _moving(tracks: list[PersonTrack]) -> tuple[PersonTrack, ...]:
    """The tracks, emptied for people who stand still; none where all do."""
    still = [track.spread_m < STILL_M for track in tracks]
    if all(still):
        return ()
    return tuple(
        PersonTrack(track.name, np.zeros(0), np.zeros((0, 2))) if rests else track
        for track, rests in zip(tracks, still, strict=True)
    )


def _notes(person: list[_Piece], track: PersonTrack) -> list[str]:
    """What is unusual about one person."""
    names = list(dict.fromkeys(piece.name for piece in person))
    notes = [f"person {names[0]} continues as {', '.join(names[1:])}: taken as one person"] if len(names) > 1 else []
    if track.spread_m > WIDE_M:
        notes.append(
            f"person {track.name} moves: up to {track.spread_m:.2f} m from the mean place over the trial, "
            "which represents them in the scene"
        )
    return notes
