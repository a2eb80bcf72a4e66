"""``navirl fit``: demonstrations to a reward."""

from math import isfinite, nan
from pathlib import Path

import click

from navirl_cli.artefacts.rewards import read_reward, reward_document
from navirl_cli.artefacts.store import Input, write_json
from navirl_cli.commands.shared import (
    Number,
    demonstrations_in,
    demos_argument,
    echo_json,
    force_option,
    json_option,
    output_option,
    progress_bar,
    say,
    text_table,
)
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.errors import DemonstrationError, RewardError
from navirl_cli.files import check_writable
from navirl_cli.irl.fit import PAPER_L2, Fit, Status
from navirl_cli.irl.fit import fit as fit_reward
from navirl_cli.irl.likelihood import evidence_of
from navirl_cli.irl.reward import Reward


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
    "--l2",
    default=PAPER_L2,
    show_default=True,
    type=Number(0, 1e6),
    help="Regulariser, nats: l2/2 times the sum of squares of c0/(10 /m), a_g, a_p and sigma_p. 0 for none.",
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
@json_option
@force_option
def fit(
    demos: Path,
    output: Path,
    initial: str,
    l2: float,
    conditions: tuple[str, ...],
    cycle: int | None,
    only_corrected: bool,
    as_json: bool,
    force: bool,
) -> None:
    """Learn a navigation reward from demonstrations.

    Maximum-entropy inverse reinforcement learning, exact: soft values, visits and derivatives come from linear systems,
    the optimum from a trust-region Newton method with several starts, standard errors from the observed information.
    """
    check_writable(output, force=force)
    earlier = () if "=" in initial or not initial else (Path(initial),)
    start = _start(initial)
    chosen = [
        d
        for d in demonstrations_in(demos)
        if (not conditions or d.condition.value in conditions)
        and (cycle is None or d.cycle == cycle)
        and (d.corrected or not only_corrected)
    ]
    evidence = evidence_of(chosen)
    resolution = _common_resolution(chosen)
    with progress_bar("fit") as update:
        result = fit_reward(evidence, start, l2, lambda step, value: update(step, f"log-likelihood {value:.3f}"))
    document = reward_document(result, chosen, [Input.of(path) for path in (demos, *earlier)], resolution)
    write_json(output, "reward", document, force=force)
    if as_json:
        echo_json(document)
    else:
        click.echo(_report(result))
    if result.status is not Status.CONVERGED:
        say(f"{result.status.value}: {result.status.advice}")


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
        raise click.BadParameter(str(error), param_hint="--init") from None


def _common_resolution(demonstrations: list[Demonstration]) -> float:
    """The cells' side, on which the meaning of the parameters per step depends."""
    sides = sorted({demonstration.grid.resolution_m for demonstration in demonstrations})
    if len(sides) > 1:
        raise DemonstrationError(
            f"demonstrations on cells of {', '.join(f'{side:g}' for side in sides)} m cannot be learnt from together: "
            "a reward per step depends on the step; extract them anew with one --resolution"
        )
    return sides[0]


def _report(result: Fit) -> str:
    """The fit as text."""
    rows = []
    for parameter, value, error, identified, on_bound in zip(
        result.reward.parameters,
        result.reward.theta,
        result.standard_errors,
        result.identified,
        result.on_bound,
        strict=True,
    ):
        remark = "" if identified else "not identified"
        rows.append(
            (
                parameter.name,
                f"{value:.4f}",
                f"{error:.4f}" if isfinite(error) else "-",
                parameter.unit or "1",
                "on its bound" if on_bound else remark or parameter.meaning,
            )
        )
    gain = result.log_likelihood - result.log_likelihood_uniform
    return "\n".join(
        (
            text_table(("parameter", "value", "std. error", "unit", "meaning"), rows),
            "",
            f"demonstrations   {result.demonstrations}, {result.steps} steps",
            f"log-likelihood   {result.log_likelihood:.4f} nats, {result.log_likelihood / result.steps:.4f} per step",
            f"  at the start   {result.log_likelihood_initial:.4f}",
            f"  uniform policy {result.log_likelihood_uniform:.4f} ({gain / result.steps:.4f} per step worse)",
            f"iterations       {result.iterations} ({result.evaluations} evaluations from all starts)",
            f"status           {result.status.value}: {result.status.advice}",
        )
    )
