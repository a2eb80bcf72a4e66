"""The recordings that count, kept on disk: a file of demonstrations for each, replaced as a whole or not at all."""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Any

from navirl_cli.artefacts.demonstrations import demonstrations_document, demonstrations_of, settings_document
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import Extraction, ExtractSettings
from navirl_cli.demos.recordings import extracted
from navirl_cli.errors import ArtefactError, NavirlError
from navirl_cli.files import Input
from navirl_cli.logs.load import LoadOptions
from navirl_cli.watching.folder import Recorded

#: Folder of the recordings' demonstrations, and the files of all of them and of the reward.
RECORDINGS, DEMOS, REWARD = "recordings", "demos.json", "reward.json"


@dataclass(frozen=True, eq=False)
class Counted:
    """A recording that counts."""

    inputs: tuple[Input, ...]
    settings: Mapping[str, Any]
    demonstrations: tuple[Demonstration, ...]

    @property
    def content(self) -> frozenset[str]:
        """Hashes of its files."""
        return frozenset(one.sha256 for one in self.inputs)

    @property
    def name(self) -> str:
        """Of its log."""
        return self.demonstrations[0].log


@dataclass(frozen=True)
class Added:
    """What became of a finished recording."""

    #: Whether the demonstrations that count have changed.
    changed: bool
    #: Why it does not count, damage, and trials that were left out.
    lost: tuple[str, ...] = ()
    #: What is unusual.
    notes: tuple[str, ...] = ()


@dataclass(eq=False)
class Visit:
    """The recordings of a visit.

    Args:
        output: Where they are kept.
        settings: Of the extraction.
        options: About the logs.
        map_file: The map in place of the logs'.
    """

    output: Path
    settings: ExtractSettings
    options: LoadOptions
    map_file: Path | None = None
    _counted: dict[str, Counted] = field(default_factory=dict)

    def open(self) -> None:
        """Read what was kept.

        Raises:
            ArtefactError: A file of it cannot be read, or the folder holds the results of other commands.
        """
        if not self._folder.is_dir():
            for name in (DEMOS, REWARD):
                if (self.output / name).exists():
                    raise ArtefactError(
                        f"{self.output}: expected an empty folder or one of an earlier watch, found {name} of another "
                        "command, which would be replaced; choose another `output`"
                    )
        for path in sorted(self._folder.glob("*.json")):
            document = read_json(path, "demonstrations")
            found = demonstrations_of(document, str(path))
            if not found:
                raise ArtefactError(f"{path}: expected the demonstrations of a recording, found none; remove the file")
            inputs = tuple(Input(**one) for one in document["inputs"])
            self._counted[path.name] = Counted(inputs, document["settings"], tuple(found))

    def __bool__(self) -> bool:
        """Whether any recording counts."""
        return bool(self._counted)

    def add(self, one: Recorded) -> Added:
        """Count a finished recording.

        A recording counts once, by the content of its files; one that has changed replaces what it was.

        Raises:
            ArtefactError: Its demonstrations cannot be written.
        """
        name = _file_name(one.key)
        before = self._counted.get(name)
        settings = json.loads(json.dumps(settings_document(self.settings, self.options, self.map_file, None)))
        try:
            if before is not None and before.settings == settings and before.content == _content(one):
                return Added(False)
        except ArtefactError as error:
            return Added(False, (str(error),))
        found = extracted((one.source, ()), self.settings, self.options, None, alone=False)
        if isinstance(found, NavirlError):
            return Added(False, (f"left out: {found}",))
        inputs, extraction = found
        lost = (*extraction.damage, *extraction.skipped)
        counted = Counted(inputs, settings, extraction.demonstrations)
        if other := self._same(name, counted):
            return Added(False, (f"left out: {one.key}: {other}",))
        document = demonstrations_document(counted.demonstrations, inputs, settings)
        self._folder.mkdir(exist_ok=True)
        write_json(self._folder / name, "demonstrations", document, force=True)
        # as a restart reads them, so that it learns the same
        kept = tuple(demonstrations_of(document, one.key))
        self._counted[name] = replace(counted, demonstrations=kept)
        return Added(True, lost, _notes(extraction, one.key, before, counted))

    def _same(self, name: str, counted: Counted) -> str | None:
        """Why a recording counts already under another name; None if it does not."""
        trials = {_place(one) for one in counted.demonstrations}
        for key, other in self._counted.items():
            if key == name:
                continue
            if other.content == counted.content:
                return f"the same recording as {other.name}, which counts once"
            if trials & {_place(one) for one in other.demonstrations}:
                return f"holds trials that {other.name} holds too, such as a repaired copy; they count once"
        return None

    def demonstrations(self) -> list[Demonstration]:
        """All that count, in the order of time, with unique ids: a participant's trials are numbered throughout."""
        found, before = [], Counter[str]()
        for counted in self._in_time:
            numbers: Counter[str] = Counter()
            for one in counted.demonstrations:
                number = int(one.id.rpartition("/")[2])
                numbers[one.participant] = max(numbers[one.participant], number)
                found.append(replace(one, id=f"{one.participant}/{before[one.participant] + number}"))
            before += numbers
        return found

    def write(self) -> Path:
        """Write the file of all demonstrations.

        Raises:
            ArtefactError: It cannot be written.
        """
        path = self.output / DEMOS
        inputs = [file for one in self._in_time for file in one.inputs]
        settings = self._in_time[-1].settings
        write_json(path, "demonstrations", demonstrations_document(self.demonstrations(), inputs, settings), force=True)
        return path

    @property
    def recordings(self) -> int:
        """Number of recordings that count."""
        return len(self._counted)

    @property
    def _folder(self) -> Path:
        return self.output / RECORDINGS

    @property
    def _in_time(self) -> list[Counted]:
        return sorted(self._counted.values(), key=lambda one: (one.demonstrations[0].start_ns, sorted(one.content)))


def _file_name(key: str) -> str:
    """The name of a recording's file: readable, unique, and the same after a restart."""
    return f"{PurePosixPath(key).name[:80]}-{sha256(key.encode()).hexdigest()[:8]}.json"


def _content(one: Recorded) -> frozenset[str]:
    return frozenset(Input.of(file).sha256 for file in one.source.files)


def _place(one: Demonstration) -> tuple[int, float, float]:
    """When and where a trial began."""
    x, y = one.xy_m[0].round(6).tolist()
    return one.start_ns, x, y


def _notes(extraction: Extraction, key: str, before: Counted | None, now: Counted) -> tuple[str, ...]:
    """What is unusual about a recording, and why it is counted anew."""
    again = []
    if before is not None:
        what = "options of the extraction have" if before.content == now.content else "it has"
        again = [f"{key}: counted anew, because {what} changed"]
    return (*again, *extraction.notes, *(f"{d.id}: {note}" for d in extraction.demonstrations for note in d.notes))
