"""What ``navirl models`` reports: models side by side, and what to keep in mind when one is chosen."""

from math import isnan
from typing import Any

from navirl_cli.documents.document import Block, Bullets, Paragraph
from navirl_cli.documents.tables import Column, Spread, Table
from navirl_cli.errors import counted
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.models import Model, Models
from navirl_cli.irl.terms import TERMS

#: With fewer participants, the standard error of a difference is rough.
FEW = 10


def models_report(found: Models) -> list[Block]:
    """The models, their formulas, and the problems of their fits."""
    return [
        Paragraph(f"{counted(len(found.participants), 'participant')}, {counted(int(found.steps.sum()), 'step')}."),
        models_table(found),
        Paragraph(_OPTIMISM),
        *_problems(found),
    ]


def models_table(found: Models) -> Table:
    """One row for each model."""
    columns = (
        Column("terms"),
        Column("parameters", "k", decimals=0),
        Column("log_likelihood", "log-likelihood nats", decimals=2),
        Column("held_out", "held-out nats a step", decimals=4),
        Column("difference", "minus the paper's", decimals=4),
        Column("in_favour", "in favour"),
        Column("status"),
    )
    return Table(columns, tuple(_row(found, model) for model in found.models), _NOTE)


def terms_table() -> Table:
    """All terms of the package: a row for each parameter."""
    columns = (
        Column("term"),
        Column("formula"),
        Column("parameter"),
        Column("unit"),
        Column("bounds"),
        Column("scanned"),
        Column("meaning"),
    )
    rows = [
        (
            f"`{term.name}`",
            f"`{term.formula}`" if one is term.parameters[0] else "",
            f"`{one.name}`",
            one.unit or "1",
            f"{one.lower:g} to {one.upper:g}",
            "yes" if one.scan else "no",
            one.meaning,
        )
        for term in TERMS.values()
        for one in term.parameters
    ]
    return Table(columns, tuple(rows))


_NOTE = (
    "Held-out: log-likelihood per step of each participant under a fit to all others. Minus the paper's: difference to "
    "the held-out value of length,deviation,personal-space, with its standard error over participants. In favour: "
    "participants whom the model predicts better than the paper's does."
)
_OPTIMISM = (
    "The best of several models looks better than it is, because it was chosen on these data. Trust a gain of several "
    "standard errors that repeats on other data."
)


def _row(found: Models, model: Model) -> tuple[Any, ...]:
    held_out = found.per_step(model)
    likelihood, status = (None, "failed") if model.fit is None else (model.fit.log_likelihood, model.fit.status.value)
    beside: tuple[Any, Any] = (None, "")
    if model is not found.paper and not isnan(held_out):
        gain = found.difference(model, found.paper)
        beside = Spread(gain.mean, gain.standard_error), f"{gain.in_favour} of {len(found.participants)}"
    return (",".join(_names(model)), model.size, likelihood, None if isnan(held_out) else held_out, *beside, status)


def _names(model: Model) -> list[str]:
    return [term.name for term in model.terms]


def _problems(found: Models) -> list[Block]:
    """Fits that failed or did not converge."""
    lines = [
        f"{','.join(_names(model))}, {f'without {name}' if name else 'all participants'}: {problem}"
        for model in found.models
        for name, problem in model.problems.items()
    ]
    return [Bullets(tuple(lines))] if lines else []


def models_remarks(found: Models) -> list[str]:
    """Warnings."""
    count = len(found.participants)
    if count >= FEW:
        return []
    return [f"standard errors of differences rest on {count} participants: they are rough with fewer than {FEW}"]


def models_lost(found: Models) -> list[str]:
    """Models without a result, with the reason."""
    return [
        f"{','.join(_names(model))}: {next(iter(model.problems.values()))}"
        for model in found.models
        if model.fit is None or isnan(found.per_step(model))
    ]


def models_document(found: Models, l2: float) -> dict[str, Any]:
    """The numbers as JSON; a model that failed has null in place of its likelihoods."""
    return {
        "participants": list(found.participants),
        "steps": found.steps.tolist(),
        "l2": l2,
        "models": [_document(found, model) for model in found.models],
    }


def _document(found: Models, model: Model) -> dict[str, Any]:
    held_out = found.per_step(model)
    known = not isnan(held_out)
    return {
        "terms": _names(model),
        "parameters": None if model.fit is None else _parameters(model.fit),
        "parameter_count": model.size,
        "log_likelihood": None if model.fit is None else model.fit.log_likelihood,
        "log_likelihood_held_out": [None if isnan(value) else value for value in model.held_out.tolist()],
        "log_likelihood_held_out_per_step": held_out if known else None,
        "difference_per_step": vars(found.difference(model, found.paper)) if known else None,
        "status": None if model.fit is None else model.fit.status.value,
        "problems": [{"left_out": name or None, "problem": problem} for name, problem in model.problems.items()],
    }


def _parameters(fit: Fit) -> dict[str, float]:
    return {one.name: value for one, value in zip(fit.reward.parameters, fit.reward.theta, strict=True)}
