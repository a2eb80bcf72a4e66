"""Print the lowest version that pyproject.toml allows of every dependency, extras too, as constraints for pip."""

import sys
import tomllib
from pathlib import Path

#: Of packages that come with a dependency: matplotlib 3.9 calls names that newer versions of pyparsing deprecate. Users
#: see nothing of it, but the tests take warnings for errors.
INDIRECT = ("pyparsing<3.3",)
#: Extras that users install. That of benchmarks needs a later mcap than navirl; tests that use it are skipped.
EXTRAS = ("cluster", "pandas", "remote", "view")
PROJECT = Path(__file__).parent.parent / "pyproject.toml"


def floors(extras: tuple[str, ...] = ()) -> list[str]:
    """One line ``name==version`` for each dependency, and for those of some extras."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *(one for extra in extras for one in project["optional-dependencies"][extra])]
    return [*(one.replace(">=", "==") for one in dict.fromkeys(needed)), *INDIRECT]


if __name__ == "__main__":
    sys.stdout.write("\n".join(floors(EXTRAS)) + "\n")
