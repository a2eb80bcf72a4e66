"""Learn how a robot should drive around people, from people who push it.

    import navirl_cli as navirl

    demos = navirl.extract("p01.mcap", "p02.mcap")
    reward = navirl.fit(demos, condition="force", cycle=2)
    navirl.evaluate(demos, reward).to_frame()
    navirl.policy(reward, demos[0]).visits
    navirl.plot.policy(reward, demos[0])

The names of ``__all__`` are the public interface. Keyword arguments have the names and defaults of the options of the
command line, and expected errors are :class:`NavirlError`. Names are loaded when they are used, so that the import is
fast.
"""

from typing import TYPE_CHECKING

__version__ = "0.1.0"

#: Where each public name is found.
_HOMES = {
    "NavirlError": "navirl_cli.errors",
    "NavirlWarning": "navirl_cli.errors",
    "evaluate": "navirl_cli.api.evaluating",
    "extract": "navirl_cli.api.calls",
    "fit": "navirl_cli.api.fitting",
    "inspect": "navirl_cli.api.calls",
    "plot": "navirl_cli.api",
    "policy": "navirl_cli.api.calls",
    "read_demonstrations": "navirl_cli.api.given",
    "read_reward": "navirl_cli.api.given",
}

if TYPE_CHECKING:
    from navirl_cli.api import plot
    from navirl_cli.api.calls import extract, inspect, policy
    from navirl_cli.api.evaluating import evaluate
    from navirl_cli.api.fitting import fit
    from navirl_cli.api.given import read_demonstrations, read_reward
    from navirl_cli.errors import NavirlError, NavirlWarning
else:

    def __getattr__(name: str) -> object:
        """Load a public name."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(_HOMES)}")
        from importlib import import_module

        home = import_module(_HOMES[name])
        found = import_module(f"{_HOMES[name]}.{name}") if name == "plot" else getattr(home, name)
        globals()[name] = found
        return found

    def __dir__() -> list[str]:
        """All names, loaded or not."""
        return sorted({*globals(), *_HOMES})


__all__ = [
    "NavirlError",
    "NavirlWarning",
    "evaluate",
    "extract",
    "fit",
    "inspect",
    "plot",
    "policy",
    "read_demonstrations",
    "read_reward",
]
