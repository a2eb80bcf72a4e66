"""``navirl fit``: demonstrations to a reward."""

from collections.abc import Sequence
from math import isfinite, nan
from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.persons import whose
from navirl_cli.artefacts.rewards import read_prior_for, read_reward, reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.cluster import workers_of
from navirl_cli.commands import completion
from navirl_cli.commands.choosing import Choosing
from navirl_cli.commands.learning import l2_option, selection_options, terms_option
from navirl_cli.commands.shared import (
    check_output,
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
    workers_options,
)
from navirl_cli.commands.types import Choice, Count, FilePath
from navirl_cli.commands.usage import Command, Example, as_options, given_words, section
from navirl_cli.documents.text import to_text
from navirl_cli.errors import RewardError
from navirl_cli.evaluation.reach import reach_effect
from navirl_cli.files import Input
from navirl_cli.irl.analyses import Pool, Questions, answers
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit, Method
from navirl_cli.irl.fit import fit as fit_reward
from navirl_cli.irl.intervals import ASKED, FEW_DEMONSTRATIONS, Kind
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward, starting
from navirl_cli.irl.selection import Steps, of_participant, select
from navirl_cli.irl.terms.term import Term
from navirl_cli.parallel import keep_freed_memory
from navirl_cli.reports.evidence import reach_unused
from navirl_cli.reports.fit import report
from navirl_cli.reports.fit_remarks import cannot_learn, remarks, warnings


@click.command(
    cls=Command,
    examples=[
        Example("One condition and cycle", "navirl fit demos.json --condition force --cycle 2 -o reward.json"),
        Example("A typical reward and one for each person", "navirl fit demos.json --pool persons -o population.json"),
        Example(
            "Another reward",
            "navirl fit demos.json --cycle 2 --terms length,deviation,length-space -o reward.json",
        ),
    ],
)
@demos_argument
@selection_options
@section(
    "Estimation",
    terms_option(),
    click.option(
        "--init",
        "initial",
        default="",
        metavar="FILE|NAME=VALUE,...",
        shell_complete=completion.initial,
        help="Initial values: a reward file, or parameters as c0=-50,a_g=-0.01,a_p=-5,sigma_p=2.",
    ),
    click.option(
        "--prior",
        "prior_file",
        type=FilePath,
        help="Earlier reward file as a Gaussian prior, with its mean and covariance; without --init it also "
        "gives the initial values.",
    ),
    click.option(
        "--person",
        metavar="NAME",
        shell_complete=completion.participants,
        help="Learn the reward of this participant from the own demonstrations and --prior, a reward fitted with "
        "--pool persons. The prior of a new person is how people are scattered, that of a known one the own reward.",
    ),
    click.option(
        "--pool",
        type=Choice([pool.value for pool in Pool]),
        default=Pool.ALL.value,
        show_default=True,
        help="One reward for all participants; or a typical one and one for each person, drawn towards the typical one "
        "as far as the own demonstrations leave it open (random effects on the logarithms of the parameters).",
    ),
    l2_option,
    click.option(
        "--method",
        type=Choice([method.value for method in Method]),
        default=Method.NEWTON.value,
        show_default=True,
        help="Trust-region Newton and a scan for other maxima, or the paper's gradient ascent (Adam); both with exact "
        "gradients.",
    ),
    click.option(
        "--correct-bias",
        is_flag=True,
        help="Subtract the first-order bias of maximum likelihood. It is large for a_p with few demonstrations.",
    ),
)
@section(
    "Uncertainty",
    click.option(
        "--intervals",
        type=Choice([kind.value for kind in ASKED]),
        help="Where 95 % intervals come from: profile likelihoods, or standard errors (wald). Default: profile with "
        f"fewer than {FEW_DEMONSTRATIONS} demonstrations or where a standard error leaves the admissible range, else "
        "wald.",
    ),
    click.option(
        "--bootstrap",
        type=Count(2, 100_000),
        metavar="N",
        help="Fit N times to participants drawn with replacement.",
    ),
    click.option(
        "--profile",
        "profiles",
        multiple=True,
        metavar="NAME",
        shell_complete=completion.parameters,
        help="Profile likelihood of this parameter with its 95 % interval, e.g. sigma_p; repeatable.",
    ),
    click.option(
        "--cross-validate",
        type=Choice(["participant"]),
        help="Predict each participant from the others, and compare with simpler models.",
    ),
    seed_option,
)
@workers_options
@section("Output", output_option("Reward file to write."), json_option, force_option)
def fit(
    demos: tuple[Path, ...],
    output: Path,
    terms: tuple[Term, ...],
    initial: str,
    prior_file: Path | None,
    person: str | None,
    pool: str,
    l2: float,
    method: str,
    choosing: Choosing,
    only_corrected: bool,
    truncated: bool,
    steps: str,
    reach: float | None,
    correct_bias: bool,
    intervals: str | None,
    bootstrap: int | None,
    profiles: tuple[str, ...],
    cross_validate: str | None,
    seed: int,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    force: bool,
) -> None:
    """Learn a navigation reward from demonstrations.

    Exact maximum-entropy inverse reinforcement learning. Linear systems give soft values, expected visits and
    derivatives; a trust-region Newton method and a scan over sigma_p give the maximum; the observed information gives
    standard errors.
    """
    kind = None if intervals is None else Kind(intervals)
    questions = Questions(correct_bias, bootstrap, profiles, bool(cross_validate), seed, kind, Pool(pool), person)
    questions.check_arguments(Steps(steps), prior=prior_file is not None, l2=l2)
    files, given = _before_work(demos, initial, prior_file, terms)
    check_output(output, files, force=force)
    everyone = demonstrations_in(*demos)
    selected = select(
        of_participant(everyone, person),
        choosing.subset,
        only_corrected=only_corrected,
        truncated=truncated,
        steps=Steps(steps),
        reach_m=reach,
    )
    chosen, evidence = selected.demonstrations, selected.evidence
    earlier = None if prior_file is None else read_prior_for(prior_file, chosen, person)
    start = _start(terms, given) if earlier is None else starting(terms, given, earlier.reward)
    questions.check(evidence, start)
    for line in cannot_learn(chosen):
        say(line)
    prior = None if earlier is None else earlier.as_prior(person)
    keep_freed_memory()
    with workers_of(workers, cluster) as executor:
        with evidence.kept_by(executor) as kept:
            plain = _learn(kept, start, prior, l2, Method(method))
        effect = reach_effect(chosen, plain, Steps(steps), reach, evidence, executor)
        others, whole = None if earlier is None else earlier.others, Steps(steps) is Steps.ALL
        found, analyses, lost = answers(
            evidence, plain, questions, others=others, whole_paths=whole, executor=executor, bars=progress_bar
        )
    inputs = [Input.of(path) for path in files]
    document = reward_document(found, chosen, inputs, selected.resolution_m, analyses, steps, effect)
    document |= {} if person is None or earlier is None else whose(person, earlier.participants)
    document["options"] = given_words()
    write_json(output, "reward", document, force=force)
    notes = remarks(chosen, earlier, chosen_by=choosing.subset.condition, everyone=everyone)
    _show(document, [*notes, *reach_unused(document, reach)], as_json=as_json)
    finish(lost)


def _show(document: dict[str, Any], notes: Sequence[str], *, as_json: bool) -> None:
    """Print the fit, and below it what a reader should know of it."""
    if as_json:
        echo_json(document)
    else:
        echo(to_text(report(document)))
    for line in (*notes, *warnings(document, status=False)):
        say(line)


def _learn(evidence: Evidence, start: Reward, prior: Prior | None, l2: float, method: Method) -> Fit:
    """The fit, with a progress bar."""
    with progress_bar("fit") as update:
        return fit_reward(
            evidence,
            start,
            l2,
            prior=prior,
            method=method,
            progress=lambda step, value: update(step, f"log-likelihood {value:.3f}"),
        )


def _before_work(
    demos: Sequence[Path], initial: str, prior_file: Path | None, terms: Sequence[Term]
) -> tuple[list[Path], Reward | dict[str, float] | None]:
    """The input files and the initial parameters of --init, of which wrong words are refused before the work."""
    given = _given(initial)
    if prior_file is None:
        _start(terms, given)
    named = [Path(initial)] if initial and "=" not in initial else []
    return [*demos, *named, *([prior_file] if prior_file else [])], given


def _given(initial: str) -> Reward | dict[str, float] | None:
    """Initial parameters from --init."""
    if not initial:
        return None
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
    return values


def _start(terms: Sequence[Term], given: Reward | dict[str, float] | None) -> Reward:
    """The reward at which the fit starts without a prior; wrong names and values are wrong words of the command."""
    try:
        return starting(terms, given)
    except RewardError as error:
        raise click.BadParameter(as_options(str(error)), param_hint="--init") from None
