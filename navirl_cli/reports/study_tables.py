"""The tables of a study's report, as texts."""

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from statistics import median

from navirl_cli.arrays import FloatArray
from navirl_cli.documents.tables import Table
from navirl_cli.evaluation.compare import DRIVEN
from navirl_cli.evaluation.groups import GroupMetrics, mean_and_spread
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.reward import Reward
from navirl_cli.study.claims import Claim
from navirl_cli.study.learning import Closeness, CycleFit, Learnt
from navirl_cli.study.pipeline import PUBLISHED_PARTICIPANTS, PUBLISHED_THETA, Study
from navirl_cli.study.questionnaire import Shares


def claims_table(claims: Iterable[Claim]) -> Table:
    """The differences that the verdicts rest on."""
    rows = [
        (
            claim.title,
            one.what,
            signed(one.paired.mean, one.unit),
            " to ".join(map(signed, one.paired.student)) if isfinite(one.paired.student.lower) else "-",
            str(one.paired.n),
            "-" if one.margin is None else f"± {one.margin:.3f}",
            ", ".join(one.against) or "-",
            one.verdict.value,
        )
        for claim in claims
        for one in claim.differences
    ]
    header = ("claim", "of", "mean difference", "95 % interval", "n", "close within", "not so for", "verdict")
    return Table.of_texts(header, tuple(rows), "Paired differences over participants.")


def completion_table(completion_s: Mapping[str, Mapping[str, tuple[float, ...]]]) -> Table:
    """Completion times by modality."""
    rows = []
    for modality, known in completion_s.items():
        times = [time for own in known.values() for time in own]
        rows.append((modality, str(len(times)), f"{median(times):.1f}", plus_minus(*mean_and_spread(times), 1)))
    return Table.of_texts(
        ("modality", "n", "median s", "mean ± standard deviation s"), tuple(rows), "Completion times."
    )


def properties_table(groups: Sequence[GroupMetrics]) -> Table:
    """Properties of driven paths by group."""
    header = (
        "paths",
        "n",
        *(f"{m.label} {m.unit}" for m in PAPER_METRICS),
        "distance of centres m",
        "leaves before person m",
    )
    rows = []
    for row in groups:
        if row.kind != DRIVEN:
            continue
        names = [*(m.name for m in PAPER_METRICS), "min_center_distance_m", "onset_m"]
        own = [plus_minus(row.mean[name], row.std[name], 3) for name in names]
        own[-1] += f" ({row.count_of('onset_m')})" if row.count_of("onset_m") else ""
        rows.append((row.group, str(row.count), *own))
    return Table.of_texts(header, tuple(rows), "Driven paths, mean ± standard deviation over paths.")


def rewards_table(study: Study) -> Table:
    """Parameters by participant and cycle, pooled, and as published."""
    parameters = Reward.named({}).parameters
    header = ("learnt from", "n", *(f"{p.name} {p.unit}".strip() for p in parameters), "log-likelihood", "status")
    rows = [
        _fit_row(f"{_whose(learnt)}, {cycle}", found.fit, found.fit.standard_errors)
        for learnt in (*study.participants, study.pooled)
        for cycle, found in _cycles(learnt)
    ]
    pooled = study.pooled.second
    if pooled is not None and pooled.fit.clustered_errors is not None:
        rows.append(_fit_row("all, errors by participant", pooled.fit, pooled.fit.clustered_errors))
    if study.published_log_likelihood is not None:
        values = [f"{PUBLISHED_THETA[parameter.name]:.4g}" for parameter in parameters]
        name = f"published, {PUBLISHED_PARTICIPANTS} participants"
        rows.append((name, "26", *values, f"{study.published_log_likelihood:.3f} of those here", "-"))
    return Table.of_texts(
        header,
        tuple(rows),
        "Parameters ± standard errors, metres throughout: from the observed information, which takes all participants "
        "for alike, and for all together also from the scatter between participants.",
    )


def closeness_table(study: Study) -> Table:
    """Expected properties beside demonstrated ones."""
    header = ("policy of", *(f"{m.label} {m.unit}: {which}" for m in PAPER_METRICS for which in ("shown", "expected")))
    rows = [
        (f"{_whose(one)}, {cycle}", *_shown_and_expected(found.near))
        for one in (*study.participants, study.pooled)
        for cycle, found in _cycles(one)
        if found.near is not None
    ]
    return Table.of_texts(
        header,
        tuple(rows),
        "Paths of the second cycle through the centres of their cells (mean ± standard deviation over paths), and "
        "what the policy expects in their scenes (mean ± standard deviation of one path).",
    )


def answers_table(bars: Sequence[Shares]) -> Table:
    """Answers by question and modality."""
    levels = len(bars[0].counts) if bars else 0
    header = ("question", "modality", "n", "median", *(f"answers {level}" for level in range(1, levels + 1)))
    rows = [
        (one.question, one.modality, str(one.count), f"{one.median:g}", *(str(count) for count in one.counts.tolist()))
        for one in bars
    ]
    return Table.of_texts(header, tuple(rows), "Answers to the questionnaire.")


def signed(value: float, unit: str = "") -> str:
    """A number with its sign."""
    return f"{value:+.3f} {unit}".rstrip().replace("-", "\N{MINUS SIGN}")


def plus_minus(mean: float, spread: float, decimals: int) -> str:
    """A mean and its spread, where they are known."""
    if not isfinite(mean):
        return "-"
    return f"{mean:.{decimals}f}" + (f" ± {spread:.{decimals}f}" if isfinite(spread) else "")


def _whose(learnt: Learnt) -> str:
    return "all" if learnt.participant is None else learnt.participant


def _cycles(learnt: Learnt) -> list[tuple[str, CycleFit]]:
    """The cycles that were learnt from."""
    return [(name, one) for name, one in (("cycle 1", learnt.first), ("cycle 2", learnt.second)) if one is not None]


def _fit_row(name: str, fit: Fit, errors: FloatArray) -> tuple[str, ...]:
    values = [_with_error(v, e) for v, e in zip(fit.reward.theta, errors.tolist(), strict=True)]
    return name, str(fit.demonstrations), *values, f"{fit.log_likelihood:.3f}", fit.status.value


def _with_error(value: float, error: float) -> str:
    """Four digits, and two of the standard error."""
    return f"{value:.4g}" + (f" ± {error:.2g}" if isfinite(error) else "")


def _shown_and_expected(near: Closeness) -> list[str]:
    return [
        plus_minus(row.expected(m.name), row.std[m.name], 2)
        for m in PAPER_METRICS
        for row in (near.demonstrated, near.learnt)
    ]
