"""Say in five sentences what `make demo` has shown, from the files that it wrote: python demo_summary.py FOLDER."""

import json
import sys
from math import log, sqrt
from pathlib import Path
from typing import Any

GROUP = "force, cycle 2"


def sentences(
    demos: dict[str, Any], reward: dict[str, Any], metrics: dict[str, Any], study: dict[str, Any]
) -> list[str]:
    """One sentence for each command.

    Args:
        demos: Content of demos.json.
        reward: Content of reward.json.
        metrics: Content of metrics.json.
        study: Content of the study's summary.json.
    """
    trials = demos["demonstrations"]
    logs, pushed = {one["log"] for one in trials}, [one for one in trials if one["contacts"]]
    contacts = sum(len(one["contacts"]) for one in pushed)
    theta = {one["name"]: one["value"] for one in reward["parameters"]}
    models = reward["cross_validation"]["models"]
    held_out = {name: one["log_likelihood_per_step"] for name, one in models.items()}
    least = {one["path_type"]: one["mean"]["min_distance_m"] for one in metrics["groups"] if one["group"] == GROUP}
    verdicts = [one["verdict"] for one in study["claims"]]
    found = (
        f"extract found {len(trials)} trials in {len(logs)} logs; in {len(pushed)} of them the person pushed the robot "
        f"({contacts} contacts)."
    )
    learnt = (
        f"fit learnt from {len(reward['demonstrations'])} of them: a step at a person's place costs "
        f"{-theta['a_p']:.1f}, and this cost halves at {sqrt(log(2) / theta['sigma_p']):.2f} m from the person."
    )
    predicted = (
        f"The fit predicts participants who were left out with {held_out['learnt']:.3f} nats per step; without a term "
        f"for people it is {held_out['no person']:.3f}, and for equally likely moves {held_out['uniform']:.3f}."
    )
    measured = (
        f"In the second cycle the robot's shell came within {least['driven']:.2f} m of the person on average; the "
        f"learnt policy keeps {least['learnt']:.2f} m, obstacle avoidance alone {least['avoidance']:.2f} m."
    )
    tested = (
        f"study tested {len(verdicts)} claims of the paper with {len(study['participants'])} participants: "
        f"{verdicts.count('holds')} supported, {verdicts.count('not settled')} not settled."
    )
    return [found, learnt, predicted, measured, tested]


def main() -> None:
    """Print the sentences, and where to look first."""
    folder = Path(sys.argv[1])
    files = ("demos.json", "reward.json", "metrics.json", "study/summary.json")
    contents = [json.loads((folder / name).read_text(encoding="utf-8")) for name in files]
    lines = [f"{number}. {text}" for number, text in enumerate(sentences(*contents), start=1)]
    lines.append(f"Look first at {folder}/policy.png, then open {folder}/study/report.html.")
    sys.stdout.write("\n" + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
