"""Results of the public functions: tables and arrays to print, write, and convert to pandas."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from navirl_cli.api.arguments import subset_in
from navirl_cli.api.frames import frame_of
from navirl_cli.arrays import FloatArray
from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.persons import of_person
from navirl_cli.artefacts.rewards import LearntReward, learnt_of
from navirl_cli.artefacts.steps import Origin
from navirl_cli.artefacts.store import write_json
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.documents.tables import ENDINGS, Format
from navirl_cli.documents.text import to_text
from navirl_cli.errors import ArgumentError, unknown
from navirl_cli.evaluation.compare import Comparison
from navirl_cli.evaluation.metric import Metric
from navirl_cli.evaluation.paired import Paired
from navirl_cli.evaluation.ranks import Ranking
from navirl_cli.files import Input, check_writable
from navirl_cli.irl.analyses import Analyses
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.paths import sample_paths, sampled_lines_m
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.irl.values import Policy
from navirl_cli.reports.evaluation import evaluation_text, write_evaluation
from navirl_cli.reports.extraction import trial_table
from navirl_cli.reports.fit import report
from navirl_cli.reports.fit_remarks import warnings

if TYPE_CHECKING:
    from pandas import DataFrame


class Demonstrations(Sequence[Demonstration]):
    """Trials, in order: a sequence of :class:`~navirl_cli.demos.demonstration.Demonstration`.

    A slice has the same sources. A list of trials is also accepted wherever demonstrations are expected.

    Attributes:
        inputs: Name and SHA-256 of the input files.
        settings: The settings of the extraction.
        notes: Remarks on the results, one text for each.
        lost: Damaged or skipped data.
        gain: The robot's gain, as in demos.json; None if it was not requested.
    """

    def __init__(
        self,
        trials: Iterable[Demonstration],
        *,
        inputs: Iterable[Input] = (),
        settings: Mapping[str, Any] | None = None,
        notes: Iterable[str] = (),
        lost: Iterable[str] = (),
        gain: Mapping[str, Any] | None = None,
        file: Input | None = None,
        origin: Origin | None = None,
    ) -> None:
        self._trials = tuple(trials)
        self.inputs, self.settings = tuple(inputs), dict(settings or {})
        self.notes, self.lost, self.gain = tuple(notes), tuple(lost), gain
        self._file, self._origin = file, origin

    def __len__(self) -> int:
        """Number of trials."""
        return len(self._trials)

    @overload
    def __getitem__(self, index: int) -> Demonstration: ...
    @overload
    def __getitem__(self, index: slice) -> "Demonstrations": ...
    def __getitem__(self, index: int | slice) -> "Demonstration | Demonstrations":
        """A trial, or several."""
        if isinstance(index, int):
            return self._trials[index]
        return self._with(self._trials[index])

    def __repr__(self) -> str:
        """The table of trials."""
        return to_text([trial_table(self)])

    def select(
        self,
        *,
        condition: str | Collection[str] = (),
        cycle: int | Collection[int] = (),
        set: str | Collection[str] = (),  # noqa: A002 the option's name
        participant: str | Collection[str] = (),
        trial: str | Collection[str] = (),
    ) -> "Demonstrations":
        """The trials of some conditions, cycles, sets, participants, or with some ids, as ``navirl select``.

        Args:
            condition: "force", "joystick", "autonomous"; one or several, as all arguments.
            cycle: Numbers of cycles.
            set: Names of sets; "main task" for trials of none.
            participant: Names of participants.
            trial: Ids.

        Raises:
            NavirlError: There are no such trials.
        """
        chosen = subset_in(condition, cycle, set, participant, trial).of(self._trials)
        return self._with(chosen)

    def _with(self, trials: Iterable[Demonstration]) -> "Demonstrations":
        """Some of the trials, with the same sources."""
        found = copy(self)
        found._trials = tuple(trials)
        return found

    def sources(self) -> tuple[Input, ...]:
        """The file that the trials were read from, or the logs that they were extracted from."""
        return self.inputs if self._file is None else (self._file,)

    def to_frame(self) -> "DataFrame":
        """The table of trials, one row for each; missing values are None or NaN.

        Returns:
            A pandas DataFrame.

        Raises:
            NavirlError: pandas is not installed.
        """
        return frame_of(trial_table(self).records())

    def write(self, path: str | Path, *, force: bool = False) -> None:
        """Write a demonstrations file, as ``navirl extract -o``.

        Args:
            path: File to write.
            force: Replace an existing file.

        Raises:
            NavirlError: The file cannot be written.
        """
        document = demonstrations_document(self, self.inputs, self.settings)
        if self.gain is not None:
            document["gain"] = dict(self.gain)
        if self._origin is not None:
            document = self._origin.recorded(document, self, Path(path).name)
        write_json(Path(path), "demonstrations", document, force=force)


@dataclass(frozen=True, eq=False, repr=False)
class FittedReward(LearntReward):
    """A learnt reward, with the content of its file.

    Attributes besides those of :class:`~navirl_cli.artefacts.rewards.LearntReward`:

    Attributes:
        document: The content of the reward file.
        notes: Remarks on the numbers, one text for each.
        lost: Requested analyses that failed, with the reason.
        fit: The fit; None for a reward that was read from a file.
        analyses: Results of the requested analyses; None for a reward that was read from a file.
        file: Name and SHA-256 of the file; None for a reward that was not read from a file.
    """

    document: Mapping[str, Any] | None = None
    notes: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    fit: Fit | None = None
    analyses: Analyses | None = None
    file: Input | None = None

    @staticmethod
    def of(learnt: LearntReward, document: Mapping[str, Any], **more: Any) -> "FittedReward":
        """A learnt reward with the content of its file."""
        known = {field.name: getattr(learnt, field.name) for field in fields(LearntReward)}
        return FittedReward(**known, document=document, **more)

    def __getitem__(self, name: str) -> float:
        """The value of a parameter, in its unit.

        Raises:
            ArgumentError: The reward has no such parameter.
        """
        values = {
            parameter.name: value for parameter, value in zip(self.reward.parameters, self.reward.theta, strict=True)
        }
        if name not in values:
            raise ArgumentError(unknown("parameter", name, values))
        return values[name]

    def person(self, name: str) -> "FittedReward":
        """The own reward of one of :attr:`persons`, after a fit with ``pool="persons"``.

        Raises:
            ArtefactError: There is no reward of this person.
        """
        content = of_person(self.document or {}, name, "reward")
        return FittedReward.of(learnt_of(content, "reward"), content, notes=tuple(warnings(content)), file=self.file)

    def __repr__(self) -> str:
        """The parameters and how the fit ended, as ``navirl fit`` prints them."""
        return "\n".join((to_text(report(self.document or {})), *(f"note: {line}" for line in self.notes)))

    def _parameters(self) -> list[dict[str, Any]]:
        """The parameters as in the file."""
        return list((self.document or {"parameters": []})["parameters"])

    def to_frame(self) -> "DataFrame":
        """The parameters, one row for each: name, unit, value, standard errors, whether the data identify it.

        Returns:
            A pandas DataFrame.

        Raises:
            NavirlError: pandas is not installed.
        """
        return frame_of(self._parameters())

    def write(self, path: str | Path, *, force: bool = False) -> None:
        """Write a reward file, as ``navirl fit -o``.

        Args:
            path: File to write.
            force: Replace an existing file.

        Raises:
            NavirlError: The file cannot be written.
        """
        write_json(Path(path), "reward", self.document or {}, force=force)


@dataclass(frozen=True, eq=False)
class ScenePolicy:
    """The policy of a reward in the scene of one demonstration, as arrays over the map.

    Attributes:
        demonstration: The trial that gives map, people, start and goal of the scene.
        reward: The reward.
        scene: The states, start, goal, people and nominal path.
        policy: Values and probabilities by state.
    """

    demonstration: Demonstration
    reward: Reward
    scene: Scene
    policy: Policy

    @property
    def grid(self) -> Grid:
        """The map: resolution_m, origin_m, extent_m, and which cells are occupied."""
        return self.scene.lattice.grid

    @cached_property
    def visits(self) -> FloatArray:
        """(rows, columns) expected visits of every cell by a path from the start; NaN where the robot cannot be."""
        return self._over_map(self.visits_by_state)

    @cached_property
    def visits_by_state(self) -> FloatArray:
        """(n,) expected visits by state."""
        return self.policy.visits_by_cell(self.scene.start)

    @cached_property
    def value(self) -> FloatArray:
        """(rows, columns) soft value: log of the partition function of the paths to the goal; NaN as in visits."""
        return self._over_map(self.policy.value_by_cell())

    @cached_property
    def state_reward(self) -> FloatArray:
        """(rows, columns) reward of a step without the cost of its length, dimensionless; NaN as in visits."""
        return self._over_map(self.reward.by_cell(self.scene))

    @cached_property
    def probability(self) -> FloatArray:
        """(rows, columns, 8) probability of each move, ordered as navirl_cli.demos.grid.MOVES; NaN as in visits."""
        return self._over_map(self.policy.probability_by_cell(self.scene.start))

    def sample(self, count: int = 20, *, seed: int = 0) -> list[FloatArray]:
        """Draw paths from start to goal.

        Args:
            count: Number of paths.
            seed: The same seed gives the same paths.

        Returns:
            For each path (k, 2) x and y of the centres of its cells, m, map frame.
        """
        paths = sample_paths(self.policy, self.scene.start, count, np.random.default_rng(seed))
        return sampled_lines_m(self.policy, paths)

    def _over_map(self, by_state: FloatArray) -> FloatArray:
        """Values by state, (n, ...), over the map, (rows, columns, ...)."""
        over = np.full((*self.grid.shape, *by_state.shape[1:]), np.nan)
        columns, rows = self.scene.lattice.cells.T
        over[rows, columns] = by_state
        return over


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row of a metrics file, one value in each column: METRIC_NAME for values by metric, METRIC for measured ones."""
    columns: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, Mapping):
            columns |= {name if key == "metrics" else f"{name}_{key}": one for name, one in value.items()}
        else:
            columns[key] = value
    return columns


#: Tables of an evaluation.
TABLES = ("groups", "demonstrations", "pairs", "ranks")


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation:
    """Metrics of demonstrated, learnt and baseline paths.

    Attributes:
        comparison: Mean and spread by group and type of path; every demonstration as driven.
        metrics: The requested metrics.
        pairs: Groups compared by participant.
        ranks: Ranks of the demonstrations among paths of the policy, and how many were not ranked.
        document: The content of a metrics file.
        notes: Which demonstrations were measured, where the reward decided it.
        quantiles: Shares whose quantiles were asked for.
    """

    comparison: Comparison
    metrics: tuple[Metric, ...]
    pairs: Sequence[tuple[str, str, Mapping[str, Paired]]]
    ranks: Ranking
    document: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    quantiles: tuple[float, ...] = ()

    def __repr__(self) -> str:
        """The tables, as ``navirl evaluate`` prints them."""
        return "\n".join((self._written(Format.TEXT), *(f"note: {line}" for line in self.notes)))

    def _written(self, how: Format) -> str:
        return evaluation_text(self.comparison, self.pairs, self.ranks, self.metrics, how, quantiles=self.quantiles)

    def to_frame(self, table: str = "groups") -> "DataFrame":
        """One of the tables.

        Args:
            table: "groups": a row for each group and type of path, with the columns METRIC_mean and
                METRIC_standard_deviation;
                "demonstrations": a row for each demonstration as driven, a column for each metric;
                "pairs": a row for each pair and metric; "ranks": a row for each ranked demonstration.

        Returns:
            A pandas DataFrame in the units of the metrics' names.

        Raises:
            NavirlError: pandas is not installed, or the table does not exist.
        """
        if table not in TABLES:
            raise ArgumentError(unknown("`table`", table, TABLES))
        rows: Any = self.document[table] or []
        if table == "ranks":
            rows = rows["demonstrations"] if rows else []
        if table == "pairs":
            rows = [
                {key: value for key, value in row.items() if key != "metrics"} | {"metric": name} | numbers
                for row in rows
                for name, numbers in row["metrics"].items()
            ]
        return frame_of([_flat(row) for row in rows])

    def write(self, path: str | Path, *, force: bool = False) -> None:
        """Write the results, as ``navirl evaluate -o``: .json, .csv, .md or .tex.

        Args:
            path: File to write.
            force: Replace an existing file.

        Raises:
            NavirlError: The ending is unknown, or the file cannot be written.
        """
        output = Path(path)
        if output.suffix.lower() not in ENDINGS:
            raise ArgumentError(f"{output}: expected a name that ends in {', '.join(ENDINGS)}, found {output.suffix!r}")
        check_writable(output, force=force)
        write_evaluation(output, self.document, self._written, force=force)
