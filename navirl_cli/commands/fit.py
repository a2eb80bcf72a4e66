"""``navirl fit``: demonstrations to a reward."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isfinite, nan
from pathlib import Path

import click
import numpy as np

from navirl_cli.artefacts.rewards import Analyses, LearntReward, read_reward, read_reward_for, reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.shared import (
    FilePath,
    Number,
    demonstrations_in,
    demos_argument,
    echo,
    echo_json,
    finish,
    force_option,
    json_option,
    output_option,
    progress_bar,
    say,
    seed_option,
)
from navirl_cli.commands.usage import as_options
from navirl_cli.demos.demonstration import Condition
from navirl_cli.documents.text import to_text
from navirl_cli.errors import NavirlError, RewardError
from navirl_cli.files import Input, check_writable
from navirl_cli.irl.bias import corrected
from navirl_cli.irl.bootstrap import bootstrap as draw_again
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import PAPER_L2, Fit, Method
from navirl_cli.irl.fit import fit as fit_reward
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.profile import number_of
from navirl_cli.irl.profile import profile as follow_profile
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps, select
from navirl_cli.irl.status import Status
from navirl_cli.irl.validation import cross_validate as leave_out
from navirl_cli.reports.fit import remarks, report, warnings


@click.command()
@demos_argument
@output_option("Reward file to write.")
@click.option(
    "--init",
    "initial",
    default="",
    help="Start: an earlier reward file, or parameters as c0=-50,a_g=-0.01,a_p=-5,sigma_p=2.",
)
@click.option(
    "--prior",
    "prior_file",
    type=FilePath,
    help="Earlier reward file, taken as a Gaussian prior with its mean and covariance; the start too without --init.",
)
@click.option(
    "--l2",
    default=PAPER_L2,
    show_default=True,
    type=Number(0, 1e6),
    help="Regulariser, nats: l2/2 times the sum of squares of c0/(10 /m), a_g, a_p and sigma_p, but for those that a "
    "--prior knows. 0 for none.",
)
@click.option(
    "--method",
    type=click.Choice([method.value for method in Method]),
    default=Method.NEWTON.value,
    show_default=True,
    help="Trust-region Newton from two starts, or the paper's gradient ascent (Adam) on the same exact gradient.",
)
@click.option(
    "--condition",
    "conditions",
    multiple=True,
    type=click.Choice([condition.value for condition in Condition]),
    help="Learn from these trials only; repeatable.",
)
@click.option("--cycle", type=int, help="Learn from the trials of this cycle only.")
@click.option("--only-corrected", is_flag=True, help="Learn from trials in which the person intervened only.")
@click.option(
    "--steps",
    type=click.Choice([steps.value for steps in Steps]),
    default=Steps.ALL.value,
    show_default=True,
    help="Learn from all steps of a path, or from those during contact only.",
)
@click.option(
    "--correct-bias",
    is_flag=True,
    help="Take off the first-order bias that maximum likelihood has with few demonstrations (it exaggerates a_p).",
)
@click.option(
    "--bootstrap", type=click.IntRange(2, 100_000), metavar="N", help="Fit N times with participants drawn anew."
)
@click.option(
    "--profile",
    "profiles",
    multiple=True,
    metavar="NAME",
    help="Follow the profile likelihood of this parameter, e.g. sigma_p, to its 95 % interval; repeatable.",
)
@click.option(
    "--cross-validate",
    type=click.Choice(["participant"]),
    help="Foretell each participant from the others, against simpler models.",
)
@seed_option
@json_option
@force_option
def fit(
    demos: Path,
    output: Path,
    initial: str,
    prior_file: Path | None,
    l2: float,
    method: str,
    conditions: tuple[str, ...],
    cycle: int | None,
    only_corrected: bool,
    steps: str,
    correct_bias: bool,
    bootstrap: int | None,
    profiles: tuple[str, ...],
    cross_validate: str | None,
    seed: int,
    as_json: bool,
    force: bool,
) -> None:
    """Learn a navigation reward from demonstrations.

    Maximum-entropy inverse reinforcement learning, exact: soft values, visits and derivatives come from linear systems,
    the optimum from a trust-region Newton method from two starts, standard errors from the observed information.
    """
    check_writable(output, force=force)
    files = [demos, *([Path(initial)] if initial and "=" not in initial else []), *([prior_file] if prior_file else [])]
    if output.resolve() in {file.resolve() for file in files}:
        raise click.UsageError(f"{output}: would replace what is read; name another output")
    if cross_validate and prior_file:
        raise click.UsageError("--cross-validate and --prior exclude each other: the prior may know who is left out")
    if correct_bias and (prior_file or steps != "all" or bootstrap or profiles or cross_validate):
        raise click.UsageError(
            "--correct-bias is for whole paths without --prior, and other questions are asked of the fit itself: "
            "leave out --prior, --steps, --bootstrap, --profile and --cross-validate"
        )
    start = _start(initial)
    selected = select(
        demonstrations_in(demos),
        conditions=conditions,
        cycle=cycle,
        only_corrected=only_corrected,
        steps=Steps(steps),
    )
    chosen, evidence = selected.demonstrations, selected.evidence
    earlier = None if prior_file is None else read_reward_for(prior_file, chosen)
    if earlier is not None and not initial:
        start = earlier.reward
    # What would be refused after the fit is refused before it.
    for name in profiles:
        number_of(start, name)
    for argument, wanted in (("bootstrap", bootstrap), ("cross_validate", cross_validate)):
        if wanted:
            evidence.several_people(argument)
    found = _learn(evidence, start, earlier, l2, Method(method))
    lost: list[str] = []
    with _kept(lost):
        found = corrected(evidence, found) if correct_bias else found
    analyses = _analyses(evidence, found, bootstrap, profiles, seed, lost, held_out=bool(cross_validate))
    document = reward_document(
        found, chosen, [Input.of(path) for path in files], selected.resolution_m, analyses, steps
    )
    write_json(output, "reward", document, force=force)
    if as_json:
        echo_json(document)
    else:
        echo(to_text(report(document)))
    for line in (*remarks(chosen, earlier, chosen_by=conditions), *warnings(document)):
        say(line)
    finish(lost)


@contextmanager
def _kept(lost: list[str]) -> Iterator[None]:
    """Trouble with a question about a fit is no trouble with the fit: it is told at the end."""
    try:
        yield
    except NavirlError as error:
        lost.append(str(error))


def _learn(evidence: Evidence, start: Reward, earlier: LearntReward | None, l2: float, method: Method) -> Fit:
    """The fit, with a bar."""
    prior = None
    if earlier is not None:
        if earlier.status in {Status.STOPPED_EARLY, Status.INFINITE}:
            raise RewardError(
                f"--prior: that fit is not at its maximum ({earlier.status.value}), and no prior; fit it anew"
            )
        prior = Prior.gaussian(np.array(earlier.reward.theta), earlier.covariance)
    with progress_bar("fit") as update:
        return fit_reward(
            evidence,
            start,
            l2,
            prior=prior,
            method=method,
            progress=lambda step, value: update(step, f"log-likelihood {value:.3f}"),
        )


def _analyses(
    evidence: Evidence,
    found: Fit,
    replicates: int | None,
    names: Sequence[str],
    seed: int,
    lost: list[str],
    *,
    held_out: bool,
) -> Analyses:
    """What was asked for besides the fit; what cannot be said is added to ``lost``."""
    drawn = validation = None
    followed = []
    if replicates:
        with _kept(lost), progress_bar("bootstrap", replicates) as update:
            drawn = draw_again(evidence, found, replicates, seed, progress=update)
    for name in dict.fromkeys(names):
        with _kept(lost), progress_bar("profile") as update:
            followed.append(follow_profile(evidence, found, name, progress=update))
    if held_out:
        with _kept(lost), progress_bar("cross-validation", len(evidence.people)) as update:
            validation = leave_out(evidence, found.initial, found.l2, progress=update)
    return Analyses(drawn, tuple(followed), validation)


def _start(initial: str) -> Reward:
    """Initial parameters from --init."""
    if not initial:
        return Reward.named({})
    if "=" not in initial:
        return read_reward(Path(initial)).reward
    values: dict[str, float] = {}
    for part in initial.split(","):
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = nan
        if name.strip() in values or not isfinite(number):
            raise click.BadParameter(f"expected name=number once each, found {part!r}", param_hint="--init")
        values[name.strip()] = number
    try:
        return Reward.named(values)
    except RewardError as error:
        raise click.BadParameter(as_options(str(error)), param_hint="--init") from None
