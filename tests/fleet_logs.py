"""Many small logs: copies of the sample logs, each with a record of its own."""

from pathlib import Path

from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.insertion import write_with_metadata

SAMPLES = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))


def copies(folder: Path, count: int) -> list[Path]:
    """Logs of equal messages and different bytes."""
    made = [folder / f"log{number:04}.mcap" for number in range(count)]
    for number, path in enumerate(made):
        with open_log(SAMPLES[number % len(SAMPLES)]) as raw, path.open("wb") as target:
            write_with_metadata(raw, target, "copy", {"number": str(number)})
    return made


def loaded(_):
    """Import what an extraction needs, in a worker."""
    import navirl_cli.demos.recordings

    return navirl_cli.demos.recordings.__name__
