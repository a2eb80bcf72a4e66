"""What ``navirl fit`` reports: parameters, their uncertainty and correlation, the likelihood, further analyses.

All of it is read from the content of a reward file, so that the page of ``navirl report`` shows the same tables.
"""

from collections.abc import Mapping, Sequence
from math import comb, inf, isfinite, isinf, nan
from typing import Any

import numpy as np

from navirl_cli.artefacts.rewards import terms_of
from navirl_cli.documents.document import Block, Bullets, Paragraph
from navirl_cli.documents.tables import Column, Interval, Table
from navirl_cli.errors import counted
from navirl_cli.irl.intervals import FEW_DEMONSTRATIONS, Ends
from navirl_cli.irl.reward import parameters_of
from navirl_cli.irl.status import Status
from navirl_cli.irl.terms.term import Parameter, Term
from navirl_cli.irl.uncertainty import condition_number, correlation
from navirl_cli.reports.evidence import reach_line
from navirl_cli.reports.fit_remarks import FEW
from navirl_cli.reports.persons import ended, person_blocks

_OF = {
    "participant": "from the scatter between participants (Student's quantile, {freedom} degrees of freedom)",
    "model": "from the likelihood",
}
_BY = {"profile": "profile likelihood", "wald": "standard errors"}
_PERSONS = {
    "participant": "random effects over {count} participants, of the typical person",
    "model": "random effects over participants, of this person",
}


def report(content: Mapping[str, Any]) -> list[Block]:
    """The fit and its analyses, the most important first.

    Args:
        content: Of the reward file.
    """
    status = Status(content["status"])
    return [
        Paragraph(f"Status: **{status.value}**: {ended(content)}."),
        parameter_table(content),
        *interval_notes(content),
        *person_blocks(content),
        meanings_of_parameters(content),
        *bootstrap_line(content),
        *profile_table(content),
        likelihood_table(content),
        *validation_tables(content),
        *correlation_table(content),
        *reach_line(content),
        Paragraph(counts(content)),
    ]


def parameter_table(content: Mapping[str, Any]) -> Table:
    """Estimates with intervals and errors, one row a parameter."""
    bootstrap = content["bootstrap"]
    drawn = zip(bootstrap["lower"], bootstrap["upper"], strict=True) if bootstrap else None
    front, behind = _by_name(content, 0), _by_name(content, 1)
    columns = (
        Column("parameter"),
        Column("value", decimals=4),
        Column("interval", "95 % interval", decimals=4),
        Column("open_ends", "open ends"),
        Column("interval_model", "as if one person", decimals=4),
        Column("bootstrap", "bootstrap 95 %", decimals=4),
        Column("standard_error_clustered", "error by participant", decimals=4),
        Column("standard_error", "std. error", decimals=4),
        Column("bias_subtracted", "bias subtracted", decimals=4),
        Column("unit"),
        Column("state"),
    )
    rows = []
    for one, declared in zip(content["parameters"], _parameters(content), strict=True):
        name = one["name"]
        rows.append(
            (
                name,
                one["value"],
                front.get(name),
                open_ends(front.get(name), declared),
                behind.get(name),
                _interval(*(next(drawn) if drawn else (None, None))),
                one["standard_error_clustered"],
                one["standard_error"],
                one["bias_subtracted"],
                one["unit"] or "1",
                "on its bound" if one["on_bound"] else "identified" if one["identified"] else "not identified",
            )
        )
    return Table(columns, tuple(rows)).without_empty()


def _by_name(content: Mapping[str, Any], number: int) -> dict[str, Interval]:
    """The ends of one set of intervals by parameter."""
    sets = content.get("intervals", [])
    if number >= len(sets):
        return {}
    return {
        one["name"]: interval_cell(Ends(one["name"], one["lower"], one["upper"])) for one in sets[number]["parameters"]
    }


def interval_cell(ends: Ends) -> Interval:
    """An interval as a cell of a table."""
    return Interval(-inf if ends.lower is None else ends.lower, inf if ends.upper is None else ends.upper)


def open_ends(interval: Interval | None, parameter: Parameter) -> str:
    """Which ends of an interval are open, in words. Empty where it is closed."""
    if interval is None:
        return ""
    ends = (("lower", interval.lower, parameter.lower), ("upper", interval.upper, parameter.upper))
    words = ["0 not excluded" if bound == 0 else f"no {name} end" for name, end, bound in ends if isinf(end)]
    return ", ".join(words)


def interval_notes(content: Mapping[str, Any]) -> list[Block]:
    """How the intervals were computed, and where they are approximate."""
    sets = content.get("intervals", [])
    if not sets:
        return []
    count = len(content["participants"])
    if sets[0]["method"] == "posterior":
        text = f"95 % intervals: {_PERSONS[sets[0]['errors']].format(count=count)}"
    else:
        text = f"95 % intervals: {_BY[sets[0]['method']]}, {_OF[sets[0]['errors']].format(freedom=count - 1)}"
    if len(sets) > 1:
        text += "; as if one person: the same for paths of one policy, too narrow where people differ"
    rough = approximate(content)
    return [Paragraph(f"{text}.{' ' + rough if rough else ''}")]


def approximate(content: Mapping[str, Any]) -> str:
    """Why the intervals in front are approximate. Empty where simulations found 92 to 98 % of them right."""
    sets = content.get("intervals", [])
    if not sets:
        return ""
    return roughness(sets[0]["method"], sets[0]["errors"], len(content["participants"]), len(content["demonstrations"]))


def roughness(method: str, errors: str, participants: int, demonstrations: int) -> str:
    """Why intervals are approximate, in a sentence or two; empty where they are not.

    Args:
        method: A :class:`~navirl_cli.irl.intervals.Kind`.
        errors: An :class:`~navirl_cli.irl.intervals.Errors`.
        participants: Whose demonstrations these are.
        demonstrations: That the reward was learnt from.
    """
    several = 1 < participants < FEW
    if method == "posterior":
        few = f" {participants} participants say little about how people differ." if several else ""
        return f"Approximate: in simulations 91 to 94 % of such intervals covered, rather than 95 %.{few}"
    if errors == "participant" and participants < FEW:
        return (
            f"Approximate, too wide rather than too narrow: {participants} participants say little about how people "
            "differ."
        )
    if errors == "model" and (several or demonstrations < FEW_DEMONSTRATIONS):
        few = "with so few demonstrations 84 to 98 % of such intervals cover, rather than 95 %"
        narrow = (
            f"too narrow if people differ, about which {participants} say little (of three people who differ by 20 %, "
            "80 to 93 % cover)"
        )
        why = [few] * (demonstrations < FEW_DEMONSTRATIONS) + [narrow] * several
        return f"Approximate: {'; '.join(why)}."
    return ""


def _interval(lower: float | None, upper: float | None) -> Interval | None:
    return None if lower is None or upper is None else Interval(lower, upper)


def _parameters(content: Mapping[str, Any]) -> tuple[Parameter, ...]:
    """Units, bounds and meanings of the parameters."""
    return parameters_of(terms_of(content))


def formula(terms: Sequence[Term]) -> Paragraph:
    """The reward as a sum of its terms, with what its symbols are."""
    symbols = dict.fromkeys(sentence for term in terms for sentence in term.symbols)
    total = " + ".join(f"`{term.formula}`" for term in terms)
    return Paragraph(" ".join([f"The reward of a step from s to s' is {total}.", *symbols]))


def meanings_of_parameters(content: Mapping[str, Any]) -> Bullets:
    """What each parameter is."""
    return Bullets(tuple(f"{one.name}: {one.meaning}" for one in _parameters(content)))


def correlation_table(content: Mapping[str, Any]) -> list[Block]:
    """Correlations of the estimates. Empty if fewer than two have a standard error."""
    covariance = np.array(content["covariance"], dtype=float)
    matrix = correlation(covariance)
    names = [one["name"] for one in content["parameters"]]
    known = [j for j in range(len(names)) if isfinite(matrix[j, j])]
    if len(known) < 2:
        return []
    columns = (Column("correlation"), *(Column(names[j], decimals=2) for j in known))
    rows = tuple((names[i], *(float(matrix[i, j]) for j in known)) for i in known)
    note = f"Condition number of the correlations: {condition_number(covariance):.3g}."
    return [Table(columns, rows, note=note)]


def likelihood_table(content: Mapping[str, Any]) -> Table:
    """Log-likelihood of the demonstrated steps under the fit, at the start, and under the uniform policy."""
    columns = (
        Column("policy"),
        Column("log_likelihood", "log-likelihood nats", decimals=4),
        Column("log_likelihood_per_step", "nats per step", decimals=4),
    )
    policies = (
        ("fitted", content["log_likelihood"]),
        ("start of the search", content["log_likelihood_initial"]),
        ("uniform", content["log_likelihood_uniform"]),
    )
    return Table(columns, tuple((name, nats, nats / content["steps"]) for name, nats in policies))


def counts(content: Mapping[str, Any]) -> str:
    """The data of the fit, and the effort, in one line."""
    taught = counted(len(content["demonstrations"]), "demonstration")
    data = f"{taught} of {people(content)}, {counted(content['steps'], 'step')}"
    effort = f"{counted(content['iterations'], 'iteration')}, {counted(content['evaluations'], 'evaluation')}"
    return f"{data}; {effort} from all starts."


def people(content: Mapping[str, Any]) -> str:
    """The number of participants from which the reward was learnt."""
    return counted(len(content["participants"]), "participant")


def bootstrap_line(content: Mapping[str, Any]) -> list[Block]:
    """The number of draws, and of those without a fit."""
    found = content["bootstrap"]
    if found is None:
        return []
    count = len(found["theta"])
    lost = [f"{found['failed']} without a fit"] if found["failed"] else []
    lost += [f"{found['stopped_early']} stopped early"] if found["stopped_early"] else []
    lost += [
        f"{one['name']} identified in {identified} of them"
        for one, identified in zip(content["parameters"], found["identified_draws"], strict=True)
        if identified < count
    ]
    text = ", ".join([f"Bootstrap: {count} draws of {people(content)} (seed {found['seed']})", *lost])
    return [Paragraph(" ".join([f"{text}.", *_rough_draws(content)]))]


def _rough_draws(content: Mapping[str, Any]) -> list[str]:
    """Why the intervals of a bootstrap are approximate."""
    number, found = len(content["participants"]), content["bootstrap"]
    why = []
    if number < FEW:
        distinct = comb(2 * number - 1, number)
        few = f", of whom there are {distinct} different draws" if distinct < len(found["theta"]) else ""
        why.append(f"Its intervals are approximate, too narrow rather than too wide: {number} people{few}.")
    fixed = [
        one["name"]
        for one, known, draws in zip(
            content["parameters"], found.get("accelerated", []), found["identified_draws"], strict=False
        )
        if draws and not known
    ]
    if fixed:
        why.append(
            f"No correction for acceleration in {', '.join(fixed)}: a fit without one participant does not identify it."
        )
    return why


def profile_table(content: Mapping[str, Any]) -> list[Block]:
    """Intervals from the profile likelihoods."""
    bounds = {one.name: (one.lower, one.upper) for one in _parameters(content)}
    columns = (
        Column("profile"),
        Column("level", "level %", decimals=0, scale=100),
        Column("lower", decimals=4),
        Column("upper", decimals=4),
        Column("open ends"),
    )
    rows = []
    for one in content["profiles"]:
        lower, upper = bounds[one["parameter"]]
        values = one["values"]
        ends = (_end("below", one["lower"], values[0], lower), _end("above", one["upper"], values[-1], upper))
        rows.append((one["parameter"], one["level"], one["lower"], one["upper"], ", ".join(filter(None, ends))))
    return [Table(columns, tuple(rows)).without_empty()] if rows else []


def _end(side: str, edge: float | None, last: float, bound: float) -> str:
    """Why an interval is open on one side. Empty if it is closed."""
    if edge is not None:
        return ""
    return f"{side}, up to the parameter's bound {bound:g}" if last == bound else f"{side}, up to {last:.4g} at least"


def validation_tables(content: Mapping[str, Any]) -> list[Block]:
    """Held-out log-likelihoods by model, and differences between demonstrated and expected features."""
    found = content["cross_validation"]
    if found is None:
        return []
    names, features = found["left_out"], found["features"]
    mismatches = tuple(
        (name, _root_mean_square(one["mismatch_standard_errors"], one["identified"]), *one["mismatch_standard_errors"])
        for name, one in features.items()
    )
    notes = [
        f"Without {participant}: {status}"
        + "".join(f", {name} not identified" for name, one in features.items() if not one["identified"][j])
        for j, (participant, status) in enumerate(zip(names, found["statuses"], strict=True))
        if status != Status.CONVERGED
    ]
    return [
        _held_out_table(found),
        Table((Column("feature of"), *(Column(name, decimals=2) for name in ("rms", *names))), mismatches, _MISMATCH),
        *([Bullets(tuple(notes))] if notes else []),
    ]


def _held_out_table(found: Mapping[str, Any]) -> Table:
    """One row a model, with its difference from the learnt one paired by participant."""
    columns = (
        Column("model"),
        Column("parameters"),
        Column("log_likelihood_per_step", "nats per step", decimals=4),
        Column("difference", "learnt minus model", decimals=4, sign=True),
        Column("standard_error", "std. error", decimals=4),
        Column("in_favour", "participants in favour of learnt"),
    )
    learnt, *_ = (_per_step(one["log_likelihood"], found["steps"]) for one in found["models"].values())
    rows = []
    for number, (model, one) in enumerate(found["models"].items()):
        own = _per_step(one["log_likelihood"], found["steps"])
        paired = np.array([a - b for a, b in zip(learnt, own, strict=True) if a is not None and b is not None])
        known = number > 0 and len(paired) > 1
        rows.append(
            (
                model,
                one.get("parameter_count"),
                one["log_likelihood_per_step"],
                float(paired.mean()) if known else None,
                float(paired.std(ddof=1) / np.sqrt(len(paired))) if known else None,
                f"{int((paired > 0).sum())} of {len(paired)}" if known else None,
            )
        )
    return Table(columns, tuple(rows), _HELD_OUT).without_empty()


_HELD_OUT = (
    "Log-likelihood per step of each participant under a fit to all others, nats. Differences: mean over participants "
    "and its standard error."
)
_MISMATCH = "Demonstrated minus expected features of each participant, |f - E f|, in standard errors."


def _per_step(log_likelihoods: Sequence[float | None], steps: Sequence[int]) -> list[float | None]:
    return [None if value is None else value / n for value, n in zip(log_likelihoods, steps, strict=True)]


def _root_mean_square(values: Sequence[float | None], counted: Sequence[bool]) -> float:
    known = np.array(values, dtype=float)[np.array(counted, dtype=bool)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else nan
