"""What ``navirl fit`` prints: the parameters, how sure they are, how well they are told apart, what they foretell."""

from collections.abc import Sequence
from math import isfinite

import numpy as np

from navirl_cli.artefacts.rewards import Analyses, LearntReward
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.documents.tables import text_table
from navirl_cli.irl.bootstrap import Bootstrap
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.profile import Profile
from navirl_cli.irl.status import Status
from navirl_cli.irl.validation import Validation

#: Participants below which their scatter says little (Cameron and Miller 2015, J. Human Resources 50:317).
FEW = 10
#: Correlation beyond which two parameters are to be read together.
TIED = 0.95


def report(found: Fit, analyses: Analyses) -> str:
    """The fit and what was asked of it besides, as text."""
    names = [parameter.name for parameter in found.reward.parameters]
    gain = found.log_likelihood - found.log_likelihood_uniform
    parts = [
        _parameters(found, analyses.bootstrap),
        _correlations(found),
        "\n".join(
            (
                f"demonstrations    {found.demonstrations} of {found.participants} participant"
                + ("s" if found.participants > 1 else "")
                + f", {found.steps} steps",
                f"log-likelihood    {found.log_likelihood:.4f} nats, {found.log_likelihood / found.steps:.4f} per step",
                f"  at the start    {found.log_likelihood_initial:.4f}",
                f"  uniform policy  {found.log_likelihood_uniform:.4f} ({gain / found.steps:.4f} per step worse)",
                f"iterations        {found.iterations} ({found.evaluations} evaluations from all starts)",
                f"status            {found.status.value}: {found.status.advice}",
            )
        ),
    ]
    if analyses.bootstrap is not None:
        parts.append(_bootstrap(analyses.bootstrap, names))
    bounds = {parameter.name: (parameter.lower, parameter.upper) for parameter in found.reward.parameters}
    parts.extend(_profile(profile, *bounds[profile.name]) for profile in analyses.profiles)
    if analyses.validation is not None:
        parts.append(_validation(analyses.validation))
    return "\n\n".join(part for part in parts if part)


def _parameters(found: Fit, bootstrap: Bootstrap | None) -> str:
    """One row a parameter."""
    header, columns = ["parameter", "value", "std. error"], []
    if found.clustered_errors is not None:
        header.append("by participant")
        columns.append([_figure(error) for error in found.clustered_errors])
    if found.bias is not None:
        header.append("bias taken off")
        columns.append([f"{bias:.4f}" for bias in found.bias])
    if bootstrap is not None:
        header.append("bootstrap 95 %")
        columns.append([f"{low:.4g} to {high:.4g}" if isfinite(low) else "-" for low, high in bootstrap.interval().T])
    rows = []
    for j, parameter in enumerate(found.reward.parameters):
        remark = parameter.meaning if found.identified[j] else "not identified: its value means nothing"
        rows.append(
            (
                parameter.name,
                f"{found.reward.theta[j]:.4f}",
                _figure(found.standard_errors[j]),
                *(column[j] for column in columns),
                parameter.unit or "1",
                "on its bound" if found.on_bound[j] else remark,
            )
        )
    return text_table((*header, "unit", "meaning"), rows)


def _correlations(found: Fit) -> str:
    """Correlations of the estimates, below the diagonal."""
    names = [parameter.name for parameter in found.reward.parameters]
    matrix = found.correlation
    told = [j for j in range(len(names)) if isfinite(matrix[j, j])]
    if len(told) < 2:
        return ""
    rows = [(names[j], *(_figure(matrix[j, i], 2) if i < j else "" for i in told[:-1])) for j in told[1:]]
    table = text_table(("correlation", *(names[i] for i in told[:-1])), rows)
    return f"{table}\ncondition number  {found.condition_number:.3g} of the correlations"


def remarks(chosen: list[Demonstration], earlier: LearntReward | None, *, chosen_by: tuple[str, ...]) -> list[str]:
    """What a user may not have meant."""
    lines = []
    alone = sum(demonstration.corrected is False for demonstration in chosen)
    if alone and not chosen_by:
        lines.append(
            f"{alone} of {len(chosen)} demonstrations show no intervention: they teach what the robot does by itself; "
            "leave them out with --only-corrected, or choose with --condition"
        )
    twice = [] if earlier is None else sorted({d.id for d in chosen} & set(earlier.demonstrations))
    if twice:
        lines.append(f"the prior was learnt from {', '.join(twice)} too: what they say counts twice")
    return lines


def warnings(found: Fit) -> list[str]:
    """What a user should know before trusting the numbers."""
    names = [parameter.name for parameter in found.reward.parameters]
    matrix = found.correlation
    lines = [
        f"{names[i]} and {names[j]} are hardly told apart (correlation {matrix[i, j]:.3f}): read them together; "
        "people at other distances, or more detours, would part them"
        for j in range(len(names))
        for i in range(j)
        if abs(matrix[i, j]) > TIED
    ]
    if 1 < found.participants < FEW:
        lines.append(
            f"errors by participant come from {found.participants} participants: rough below {FEW}, and too small "
            "where there are no more participants than parameters"
        )
    if found.status is not Status.CONVERGED:
        lines.append(f"{found.status.value}: {found.status.advice}")
    return lines


def _bootstrap(found: Bootstrap, names: Sequence[str]) -> str:
    """How many draws there were."""
    lost = f", {found.failed} without a fit" if found.failed else ""
    early = f", {found.stopped_early} stopped early" if found.stopped_early else ""
    count = len(found.theta)
    untold = "".join(f", {n} told in {told} of them" for n, told in zip(names, found.told, strict=True) if told < count)
    return f"bootstrap         {count} draws of participants (seed {found.seed}){lost}{early}{untold}"


def _profile(found: Profile, lower: float, upper: float) -> str:
    """The interval; an open end reaches to the parameter's bound or has none."""
    ends = [
        f"{end:.4f}" if end is not None else f"{bound:g} (its bound)" if last == bound else "open"
        for end, last, bound in ((found.lower, found.values[0], lower), (found.upper, found.values[-1], upper))
    ]
    return f"profile           {found.name}: {100 * found.level:.0f} % interval {ends[0]} to {ends[1]}"


def _validation(found: Validation) -> str:
    """Held-out log-likelihoods by model, and the features."""
    models = [
        (model, f"{found.per_step(model):.4f}", *(f"{v:.4f}" for v in values / found.steps))
        for model, values in found.log_likelihoods.items()
    ]
    likelihoods = text_table(("log-likelihood per step, left out", "all", *found.participants), models)
    told = np.where(found.identified, found.mismatch**2, 0.0)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(told.sum(axis=0) / found.identified.sum(axis=0))
    features = [
        (parameter.name, _figure(root[j], 2), *(_figure(v, 2) for v in row))
        for j, (parameter, row) in enumerate(zip(found.parameters, found.mismatch.T, strict=True))
    ]
    matches = text_table(("|f_demo - E f|, std. errors, left out", "rms", *found.participants), features)
    notes = [
        f"without {participant}: {status.value}"
        + "".join(f", {p.name} not told" for p, told in zip(found.parameters, identified, strict=True) if not told)
        for participant, status, identified in zip(found.participants, found.statuses, found.identified, strict=True)
        if status is not Status.CONVERGED
    ]
    return "\n\n".join((likelihoods, matches, *(["\n".join(notes)] if notes else [])))


def _figure(value: float, digits: int = 4) -> str:
    """A number, or a dash where there is none."""
    return f"{value:.{digits}f}" if isfinite(value) else "-"
