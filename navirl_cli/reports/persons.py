"""People who differ: how much, and the reward of each."""

from collections.abc import Mapping, Sequence
from typing import Any

from navirl_cli.documents.document import Block, Paragraph
from navirl_cli.documents.tables import Column, Interval, Table
from navirl_cli.irl.random_effects import AGREES, PRECISE
from navirl_cli.irl.status import Status

#: With fewer effective draws a person's numbers are rough.
FEW_DRAWS = 20
_ENDED = {
    Status.CONVERGED: (
        f"another draw moves the typical reward and the scatters by less than {AGREES:g} standard errors, and all "
        f"draws leave an error of less than {PRECISE:g}"
    ),
    Status.STOPPED_EARLY: (
        f"a draw still moves the typical reward or the scatters by more than {AGREES:g} standard errors, or all draws "
        f"leave an error of more than {PRECISE:g}: all numbers are approximate; more demonstrations of each person help"
    ),
}


def ended(content: Mapping[str, Any]) -> str:
    """How the fit ended and what that means; people who differ are integrated over, not at a maximum.

    Args:
        content: Of the reward file.
    """
    status = Status(content["status"])
    return _ENDED.get(status, status.advice) if content.get("population") else status.advice


def person_blocks(content: Mapping[str, Any]) -> list[Block]:
    """How people are scattered, and each of them; empty for one reward for all.

    Args:
        content: Of the reward file.
    """
    population = content.get("population")
    if population is None:
        return own_note(content)
    return [
        Paragraph(
            "The parameters above are of the **typical person**: half of the people are below, half above. Their "
            "intervals are of that typical value, not of a person's."
        ),
        scatter_table(population),
        persons_table(population),
        Paragraph(f"{sampled(population)} {likelihoods(population)}"),
    ]


def own_note(content: Mapping[str, Any]) -> list[Block]:
    """Whose reward this is; empty for one reward for all."""
    if "person" not in content:
        return []
    others = len(content.get("shrunk_towards", ()))
    return [
        Paragraph(
            f"The reward of **{content['person']}**: own demonstrations, and how {others} other people are scattered."
        )
    ]


def scatter_table(population: Mapping[str, Any]) -> Table:
    """By parameter the standard deviation of the logarithm between people."""
    columns = (
        Column("parameter"),
        Column("scatter", "people differ by %", decimals=0, scale=100),
        Column("scatter_interval", "95 % interval", decimals=0, scale=100),
        Column("people_differ", "all alike is"),
    )
    rows = [
        (
            one["name"],
            one["scatter"],
            Interval(one["scatter_lower"], one["scatter_upper"]),
            "excluded" if one["people_differ"] else "not excluded",
        )
        for one in population["parameters"]
    ]
    note = "Standard deviation between people of the logarithm of a parameter; 20 % is a factor of 1.2 up or down."
    return Table(columns, tuple(rows), note)


def persons_table(population: Mapping[str, Any]) -> Table:
    """Each person's parameters with their intervals."""
    names = [one["name"] for one in population["parameters"]]
    columns = [Column("person"), Column("demonstrations")]
    for name in names:
        columns += [Column(name, decimals=3), Column(f"{name}_interval", "95 % interval", decimals=3)]
    rows = []
    for one in population["persons"]:
        known = {parameter["name"]: parameter for parameter in one["parameters"]}
        own = [known[name] for name in names]
        cells = [cell for each in own for cell in (each["value"], Interval(each["lower"], each["upper"]))]
        rows.append((one["name"], len(one["demonstrations"]), *cells))
    note = "Each person's reward, drawn towards the typical one as far as the own demonstrations leave it open."
    return Table(tuple(columns), tuple(rows), note)


def sampled(population: Mapping[str, Any]) -> str:
    """How well the people's distributions were sampled, in one sentence."""
    worst = min(population["persons"], key=lambda one: one["effective_draws"] or 0)
    count = worst["effective_draws"] or 0.0
    return (
        f"By importance sampling, {worst['draws']} draws a person, whose effective number is at least {count:.0f} "
        f"({worst['name']})."
    )


def likelihoods(population: Mapping[str, Any]) -> str:
    """The likelihood with differences between people, and without."""
    differ, alike = population["log_likelihood"], population["log_likelihood_alike"]
    shown = any(one["people_differ"] for one in population["parameters"])
    unshown = " The demonstrations do not show that people differ: the scatters above owe much to their weak prior."
    return (
        f"Log-likelihood with people who differ as above, integrated over the reward of each: {differ:.2f}; people "
        f"alike: {alike:.2f} ({differ - alike:+.2f}).{'' if shown else unshown}"
    )


def person_warnings(content: Mapping[str, Any]) -> list[str]:
    """What a user should know before trusting the rewards of people."""
    population = content.get("population")
    if population is None:
        return []
    rough = [one["name"] for one in population["persons"] if _is_rough(one)]
    lines = []
    if rough:
        lines.append(
            f"the distribution of {', '.join(rough)} was sampled badly (fewer than {FEW_DRAWS} effective draws): "
            "their numbers are rough"
        )
    held = [one["name"] for one in content["parameters"] if one["name"] not in _names(population)]
    if held:
        lines.append(
            f"{' and '.join(held)} {'is' if len(held) == 1 else 'are'} the same for all people, because the pooled fit "
            "does not identify or ends on a bound there"
        )
    return lines


def _is_rough(one: Mapping[str, Any]) -> bool:
    return bool((one["effective_draws"] or 0.0) < FEW_DRAWS)


def _names(population: Mapping[str, Any]) -> Sequence[str]:
    return [one["name"] for one in population["parameters"]]
