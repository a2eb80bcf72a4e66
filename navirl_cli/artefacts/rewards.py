"""Reward files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.artefacts.analyses import (
    bootstrap_document,
    intervals_document,
    intervals_of,
    profile_document,
    profile_of,
    reach_document,
    validation_document,
)
from navirl_cli.artefacts.persons import for_person, names_of_persons, of_person, others_of, population_document
from navirl_cli.artefacts.store import number, numbers, read_json, row
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import ArtefactError, NavirlError, RewardError
from navirl_cli.evaluation.groups import Trained, by_evidence_group
from navirl_cli.files import Input
from navirl_cli.irl.analyses import Analyses, Pool
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.intervals import Intervals
from navirl_cli.irl.newcomer import Others
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.profile import Profile
from navirl_cli.irl.reward import Reward, parameters_of, terms_with
from navirl_cli.irl.status import Status
from navirl_cli.irl.terms.registry import names_of, terms_named
from navirl_cli.irl.terms.term import Term

if TYPE_CHECKING:  # a reader of rewards does not fit again
    from navirl_cli.evaluation.reach import ReachEffect


@dataclass(frozen=True, eq=False)
class Search(ByContent):
    """The steps of the search that found the maximum, from its start, without a bias correction."""

    #: (m,) nats.
    log_likelihood: FloatArray
    #: (m, k) in the parameters' units.
    theta: FloatArray


@dataclass(frozen=True, eq=False)
class LearntReward(ByContent):
    """A reward as read from its file."""

    reward: Reward
    #: (k, k), NaN for parameters without a standard error.
    covariance: FloatArray
    #: Side of the cells on which it was learnt, m.
    resolution_m: float
    #: Ids of the demonstrations from which it was learnt.
    demonstrations: tuple[str, ...]
    #: How the fit ended.
    status: Status
    #: Profile likelihoods.
    profiles: tuple[Profile, ...] = ()
    #: Groups of these demonstrations; None for files from before they were written.
    groups: tuple[str, ...] | None = None
    #: Those whose demonstrations it was learnt from; for one person's reward also those towards whom it is drawn.
    participants: tuple[str, ...] = ()
    #: None for files from before it was written.
    search: Search | None = None
    #: Intervals of the parameters, by participant first; none in files from before they were written.
    intervals: tuple[Intervals, ...] = ()
    #: People whose own rewards the file holds beside this typical one; none for one reward for all.
    persons: tuple[str, ...] = ()
    #: What these people say about the next one.
    others: Others | None = None

    def trained(self, demonstrations: Sequence[Demonstration]) -> Trained | None:
        """What it was learnt from; None where neither its file nor the demonstrations say which groups.

        Args:
            demonstrations: Among them perhaps those from which it was learnt.
        """
        ids = frozenset(self.demonstrations)
        own = [one for one in demonstrations if one.id in ids]
        groups = frozenset(by_evidence_group(own) if self.groups is None else self.groups)
        people = frozenset(self.participants) or frozenset(one.participant for one in own)
        return Trained(ids, people, groups) if groups else None

    def as_prior(self, person: str | None = None) -> Prior:
        """The prior that this fit gives to the next one.

        Args:
            person: The next person, where the fit is of people who differ.

        Raises:
            RewardError: The fit did not reach its maximum, its covariance is not positive definite, or it is of people
                who differ.
        """
        if self.others is not None and person is None:
            raise RewardError(
                "`prior`: expected one reward, found one for each person; say whose reward to learn with `person`"
            )
        if self.others is not None:  # integrated over, so that there is no maximum to reach
            return self.others.prior()
        if self.status in {Status.STOPPED_EARLY, Status.INFINITE}:
            raise RewardError(
                f"`prior`: expected a fit at its maximum, found one that ended with {self.status.value}; fit it again"
            )
        return Prior.gaussian(np.array(self.reward.theta), self.covariance)


def reward_document(
    fit: Fit,
    demonstrations: Sequence[Demonstration],
    inputs: Sequence[Input],
    resolution_m: float,
    analyses: Analyses | None = None,
    learnt_from: str = "all",
    reach: "ReachEffect | None" = None,
) -> dict[str, Any]:
    """A fit with its analyses as the content of a reward file.

    Args:
        fit: The fit.
        demonstrations: Those from which it was learnt.
        inputs: Files that were read.
        resolution_m: Side of the cells, m.
        analyses: Bootstrap, profiles and cross-validation, where they were asked for.
        learnt_from: "all" steps, those during "contact", or those "reachable".
        reach: All steps beside those within reach, where it is known.
    """
    analyses = analyses or Analyses()
    return {
        "inputs": [vars(one) for one in inputs],
        "terms": names_of(fit.reward.terms),
        "parameters": _parameters(fit, analyses.bias),
        "covariance": numbers(fit.covariance),
        "covariance_clustered": None if fit.clustered is None else numbers(fit.clustered),
        "condition_number": number(fit.condition_number),
        "resolution_m": resolution_m,
        "status": fit.status.value,
        "method": fit.method.value,
        "l2": fit.l2,
        "prior": fit.prior is not None,
        "initial": {p.name: value for p, value in zip(fit.initial.parameters, fit.initial.theta, strict=True)},
        "log_likelihood": fit.log_likelihood,
        "log_likelihood_initial": fit.log_likelihood_initial,
        "log_likelihood_uniform": fit.log_likelihood_uniform,
        "demonstrations": [demonstration.id for demonstration in demonstrations],
        "participants": sorted({demonstration.participant for demonstration in demonstrations}),
        **_pooled(analyses, demonstrations),
        "learnt_from": learnt_from,
        "groups": list(by_evidence_group(demonstrations)),
        "reach": None if reach is None else reach_document(reach),
        "steps": fit.steps,
        "iterations": fit.iterations,
        "evaluations": fit.evaluations,
        "search": {"log_likelihood": fit.path_log_likelihood.tolist(), "theta": fit.path_theta.tolist()},
        "intervals": [intervals_document(one) for one in analyses.intervals],
        "bootstrap": None if analyses.bootstrap is None else bootstrap_document(analyses.bootstrap),
        "profiles": [profile_document(one) for one in analyses.profiles],
        "cross_validation": None if analyses.validation is None else validation_document(analyses.validation),
    }


def _pooled(analyses: Analyses, demonstrations: Sequence[Demonstration]) -> dict[str, Any]:
    """Whether there is a reward for each person, and these."""
    if analyses.population is None:
        return {"pool": Pool.ALL.value}
    found = population_document(analyses.population, [one.id for one in demonstrations])
    return {"pool": Pool.PERSONS.value, "population": found}


def _parameters(fit: Fit, expected: FloatArray | None) -> list[dict[str, Any]]:
    """Estimate and errors by parameter; expected is the bias, where it is known and not subtracted."""
    nothing = np.full(len(fit.standard_errors), np.nan)
    robust = nothing if fit.clustered_errors is None else fit.clustered_errors
    biases = nothing if fit.bias is None else fit.bias
    return [
        {
            "name": parameter.name,
            "unit": parameter.unit,
            "value": value,
            "standard_error": number(error),
            "standard_error_clustered": number(clustered),
            "bias_subtracted": number(bias),
            "bias_expected": number(to_expect),
            "identified": bool(identified),
            "on_bound": bool(on_bound),
        }
        for parameter, value, error, clustered, bias, to_expect, identified, on_bound in zip(
            fit.reward.parameters,
            fit.reward.theta,
            fit.standard_errors,
            robust,
            biases,
            nothing if expected is None else expected,
            fit.identified,
            fit.on_bound,
            strict=True,
        )
    ]


def terms_of(document: Mapping[str, Any]) -> tuple[Term, ...]:
    """The terms of a reward file's content.

    Raises:
        RewardError: A term is not installed, or the parameters are not those of the terms.
    """
    names = [parameter["name"] for parameter in document["parameters"]]
    if "terms" not in document:
        return terms_with(names)  # files from before terms were named
    terms = terms_named(document["terms"])
    own = [parameter.name for parameter in parameters_of(terms)]
    if names != own:
        raise RewardError(
            f"parameters: expected {', '.join(own)}, as of the terms {', '.join(document['terms'])}, found "
            f"{', '.join(names)}"
        )
    return terms


def reward_content(path: Path, person: str | None = None) -> dict[str, Any]:
    """The content of a reward file.

    Args:
        path: The file.
        person: One of the people whose rewards it holds, whose reward stands in place of the typical one.

    Raises:
        ArtefactError: As in :func:`read_json`, or the file holds no reward of this person.
    """
    content = read_json(path, "reward")
    return content if person is None else of_person(content, person, str(path))


def read_reward(path: Path, person: str | None = None) -> LearntReward:
    """A reward of a file; arguments as of :func:`reward_content`.

    Raises:
        ArtefactError: As in :func:`reward_content`, or the parameters are not those of a reward.
    """
    return learnt_of(reward_content(path, person), str(path))


def learnt_of(document: Mapping[str, Any], path: str) -> LearntReward:
    """The reward of a file's content.

    Args:
        document: As :func:`reward_document` makes it.
        path: Where it comes from, for messages.

    Raises:
        ArtefactError: The parameters are not those of a reward.
    """
    values = {parameter["name"]: parameter["value"] for parameter in document["parameters"]}
    names = [parameter["name"] for parameter in document["parameters"]]
    try:
        reward = Reward.named(values, terms_of(document))
    except NavirlError as error:
        raise ArtefactError(f"{path}: {error}") from error
    covariance = [row(one) for one in document["covariance"]]
    if len(covariance) != len(names) or any(len(one) != len(names) for one in covariance):
        raise ArtefactError(f"{path}: covariance: expected {len(names)} rows of {len(names)} numbers")
    profiles = tuple(profile_of(one, names, path) for one in document["profiles"])
    return LearntReward(
        reward=reward,
        covariance=np.array(covariance),
        resolution_m=document["resolution_m"],
        demonstrations=tuple(document["demonstrations"]),
        groups=tuple(document["groups"]) if "groups" in document else None,
        participants=(*document["participants"], *document.get("shrunk_towards", ())),
        status=Status(document["status"]),
        profiles=profiles,
        intervals=tuple(intervals_of(one, names, path) for one in document.get("intervals", ())),
        search=_search(document.get("search"), len(names), path),
        persons=tuple(names_of_persons(document)),
        others=others_of(document, reward, path),
    )


def _search(content: Mapping[str, Any] | None, count: int, path: str) -> Search | None:
    """The steps of the search in a file.

    Raises:
        ArtefactError: A parameter does not have one value for each likelihood.
    """
    if content is None:
        return None
    nats, theta = content["log_likelihood"], content["theta"]
    if len(theta) != len(nats) or any(len(one) != count for one in theta):
        raise ArtefactError(
            f"{path}: search/theta: expected {len(nats)} rows of {count} numbers, as search/log_likelihood"
        )
    return Search(np.array(nats, dtype=float), np.array(theta, dtype=float))


def read_reward_for(path: Path, demonstrations: Sequence[Demonstration], person: str | None = None) -> LearntReward:
    """The reward of a file, for use on demonstrations; person as in :func:`reward_content`.

    Raises:
        ArtefactError: As in :func:`read_reward`, or the reward was learnt on cells of another size: a reward per step
            means something else where steps have another length.
    """
    learnt = read_reward(path, person)
    check_cells(learnt, demonstrations, str(path))
    return learnt


def read_prior_for(path: Path, demonstrations: Sequence[Demonstration], person: str | None) -> LearntReward:
    """An earlier reward of a file, for learning from demonstrations.

    Args:
        path: The file.
        demonstrations: Those to learn from.
        person: Whose reward is learnt; None for that of all.

    Raises:
        ArtefactError: As in :func:`read_reward_for`, or the file holds one reward for all, and a person is named.
    """
    content = reward_content(path)
    learnt = learnt_of(content if person is None else for_person(content, person, str(path)), str(path))
    check_cells(learnt, demonstrations, str(path))
    return learnt


def check_cells(learnt: LearntReward, demonstrations: Sequence[Demonstration], name: str) -> None:
    """Refuse a reward on cells of another size than those that it was learnt on.

    Raises:
        ArtefactError: The sizes differ; the message begins with the name.
    """
    others = {d.grid.resolution_m for d in demonstrations if not np.isclose(d.grid.resolution_m, learnt.resolution_m)}
    if others:
        raise ArtefactError(
            f"{name}: learnt on cells of {learnt.resolution_m:g} m, but the demonstrations lie on cells of "
            f"{min(others):g} m; extract them with `resolution` {learnt.resolution_m:g}, or fit again"
        )
