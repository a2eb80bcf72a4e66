"""The loop of a visit: look, extract, learn, plan, say."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from math import nan
from pathlib import Path

from navirl_cli.artefacts.rewards import read_reward
from navirl_cli.errors import NavirlError
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.smooth import Limits
from navirl_cli.reports.fit_remarks import remarks
from navirl_cli.reports.watch import learnt_line
from navirl_cli.watching.folder import Folder, Look, pause_s
from navirl_cli.watching.learning import (
    Choice,
    Learnt,
    confirmed,
    draw_paths,
    learn,
    next_paths,
    write_paths,
    write_reward,
)
from navirl_cli.watching.visit import REWARD, Visit

#: What the loop says: results, and what is unusual or lost.
Say = Callable[[str], None]


@dataclass(eq=False)
class Watch:
    """The loop of a visit.

    Args:
        folder: The recordings.
        visit: Those that count.
        choice: Which demonstrations count, and the earlier reward.
        limits: Of the robot on planned paths.
        result: Takes the line on what is learnt.
        note: Takes what is unusual, each thing once.
    """

    folder: Folder
    visit: Visit
    choice: Choice
    limits: Limits
    result: Say
    note: Say
    #: What was left out, in order.
    lost: list[str] = field(default_factory=list)
    _said: set[str] = field(default_factory=set)

    def run(self, *, once: bool) -> None:
        """Learn whenever a recording is finished; ``once``: return when all that do not grow are counted.

        Raises:
            LogError: The folder is missing.
            ArtefactError: A result cannot be read or written.
        """
        self.folder.look()  # refuses a missing folder before anything is written
        self.visit.open()
        # whatever a killed process left undone is done again
        due = bool(self.visit)
        while True:
            began = time.process_time()
            look = self.folder.look()
            cost = time.process_time() - began
            due = self._count(look) or due
            if due:
                self.learn()
                due = False
            if once and not look.ready and all(grown for _, grown in look.open):
                for key, _ in look.open:
                    self._lose(f"{key}: still grows; left out")
                for line in look.refused:
                    self._lose(line)
                return
            time.sleep(pause_s(cost))

    def _count(self, look: Look) -> bool:
        """Count finished recordings; whether any changed what counts."""
        changed = False
        for one in look.ready:
            added = self.visit.add(one)
            if not self.folder.take(one):  # it has grown meanwhile, and is looked at again
                changed = changed or added.changed
                continue
            changed = changed or added.changed
            for line in added.lost:
                self._lose(line)
            for line in added.notes:
                self._note(line)
        return changed

    def learn(self) -> None:
        """Write reward, paths and figure, and say what is learnt; then confirm it."""
        try:
            demos = self.visit.write()
            before = self._before()
            learnt = learn(self.visit.demonstrations(), self.choice)
            self._write(learnt, demos)
            self._say(learnt, before)
            learnt, why = confirmed(learnt, self.choice)
            if why:
                self._write(learnt, demos)
                self._say(learnt, before, f"{why}: ")
            else:
                write_reward(self.visit.output, learnt, self.choice, demos)
        except NavirlError as error:
            self._lose(f"nothing is learnt: {error}")
            return
        chosen, by = learnt.selection.demonstrations, self.choice.conditions
        for line in (*learnt.lost, *remarks(chosen, self.choice.earlier, chosen_by=by)):
            self._note(line)

    def _write(self, learnt: Learnt, demos: Path) -> None:
        """Write the paths, for which the robot waits, then reward and figure."""
        output = self.visit.output
        paths = next_paths(learnt, self.limits)
        write_paths(output, paths, [demos])
        write_reward(output, learnt, self.choice, demos)
        draw_paths(output, paths)

    def _before(self) -> Reward | None:
        """The reward before: that of the visit so far, else the earlier one."""
        with suppress(NavirlError):
            return read_reward(self.visit.output / REWARD).reward
        return None if self.choice.earlier is None else self.choice.earlier.reward

    def _say(self, learnt: Learnt, before: Reward | None, prefix: str = "") -> None:
        count = len(learnt.selection.demonstrations)
        was = nan if before is None else learnt.passing_m(before)
        self.result(prefix + learnt_line(learnt.certainty, was, count, self.visit.recordings))

    def _note(self, line: str) -> None:
        if line not in self._said:
            self._said.add(line)
            self.note(line)

    def _lose(self, line: str) -> None:
        if line not in self.lost:
            self.lost.append(line)
            self._note(line)
