"""Extraction from the logs that a user named, for the commands that begin with it."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from navirl_cli.artefacts.store import Input
from navirl_cli.commands.shared import bytes_bar
from navirl_cli.demos.extract import Extraction, ExtractSettings
from navirl_cli.demos.extract import extract as extract_one
from navirl_cli.errors import DemonstrationError, LogError, NavirlError
from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.messages.reader import Progress
from navirl_cli.logs.sources import Source, sources_of
from navirl_cli.parallel import map_in_order

#: The hashes of a recording's files, and what came out of it.
Result = tuple[tuple[Input, ...], Extraction]


def all_extracted(
    logs: Sequence[Path], settings: ExtractSettings, options: LoadOptions, *, join: bool
) -> tuple[list[Result], list[str]]:
    """What came out of each recording, and what is wrong with those of which nothing did.

    Args:
        logs: What the user named.
        settings: Of the extraction.
        options: What the user said of the logs.
        join: Whether all are pieces of one recording.

    Raises:
        NavirlError: Nothing came out of any.
    """
    refused: list[LogError] = []
    # where all are pieces of one recording none may be missing
    sources = sources_of(logs, join=join, refused=None if join else refused)
    good: dict[tuple[str, ...], Result] = {}
    failed: list[NavirlError] = [*refused]
    sizes = [sum(path.stat().st_size for path in source.files) for source in sources]
    done = 0
    with bytes_bar("extract") as update:
        # a lone recording is read here, so that the bar can follow its bytes
        work = partial(_extracted, settings=settings, options=options, progress=update if len(sources) == 1 else None)
        for source, size, result in zip(sources, sizes, map_in_order(work, sources), strict=True):
            if isinstance(result, NavirlError):
                failed.append(result)
            elif (key := tuple(sorted(file.sha256 for file in result[0]))) in good:
                failed.append(DemonstrationError(f"{source.name}: the same recording as {good[key][1].log}"))
            else:
                good[key] = result
            done += size
            update(done, sum(sizes))
    if len(failed) == 1 and not good:
        raise failed[0]
    if not good:
        raise DemonstrationError("none of the logs can be used: " + "; ".join(str(error) for error in failed))
    return list(good.values()), [f"left out: {error}" for error in failed]


def _extracted(
    source: Source, settings: ExtractSettings, options: LoadOptions, progress: Progress | None
) -> Result | NavirlError:
    """One recording's demonstrations, or why there are none: one bad log must not spoil the others."""
    try:
        with ThreadPoolExecutor(1) as pool:
            hashes = pool.submit(lambda: tuple(Input.of(path) for path in source.files))
            extraction = extract_one(load_recording(source, options, progress), settings)
            return hashes.result(), extraction
    except NavirlError as error:
        return error
