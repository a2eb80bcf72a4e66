"""Keys of JSON follow one rule: a number's key ends in its unit, or is one of the few that have none."""

import json
from pathlib import Path

import published_factory as forge
import pytest

from navirl_cli.artefacts.store import read_json, schema_path
from navirl_cli.evaluation.metrics import METRICS
from navirl_cli.irl.reward import parameters_of
from navirl_cli.irl.terms import TERMS

#: Artefacts of version 1 and those that came later.
FIRST = ("demonstrations", "reward", "metrics", "study")
KINDS = (*FIRST, "plan", "manifest")
ROOT = Path(__file__).parent.parent
UNITS = ("s", "hz", "m", "m2", "m_s", "m_s2", "m_s3", "1_m", "rad", "n", "n_s", "m_s_n", "j", "share", "bytes")
#: Counts, numbers of order, statistics without a unit.
WITHOUT = {
    *(
        "version",
        "seed",
        "count",
        "n",
        "participants",
        "demonstrations",
        "paths",
        "trials",
        "trial",
        "labelled",
        "messages",
        "steps_all",
        "steps_reachable",
        "gaps",
        "cells",
    ),
    *(
        "contacts",
        "cycle",
        "pushes",
        "steps",
        "samples",
        "levels",
        "iterations",
        "evaluations",
        "failed",
        "stopped_early",
    ),
    *("identified_draws", "counts", "median", "cells_equal", "theta_participants"),
    *(
        "precision",
        "rank",
        "distance_rank",
        "area_rank",
        "not_ranked",
        "rank_biserial",
        "cohen_dz",
        "wilcoxon_p",
        "holm_p",
        "p_value",
        "statistic",
        "level",
        "l2",
    ),
    *("condition_number", "mismatch_standard_errors", "parameter_count"),
    # how people are scattered: of logarithms
    *("log_mean", "log_covariance", "scatter", "scatter_lower", "scatter_upper", "scatter_rms"),
    *("draws", "effective_draws"),
}
#: Nanoseconds are for times of day only: beside them, n_s is newton seconds.
TIMES_NS = {"start_ns", "end_ns"}
#: Nats, which are numbers without a unit.
NATS = ("log_likelihood", "log_probability", "reward_by_term")
#: Values of what the rest of their object or the key around them names: a metric, or a parameter beside its unit.
STATISTICS = {
    *("mean", "standard_deviation", "half_interval", "monte_carlo_error", "exact", "mean_difference", "margin"),
    *("lower", "upper", "student_lower", "student_upper", "bootstrap_lower", "bootstrap_upper", "by_participant"),
    *("value", "values", "standard_error", "standard_error_clustered", "standard_errors", "standard_errors_clustered"),
    *(
        "bias_subtracted",
        "parameters",
        "bias_expected",
        "covariance",
        "covariance_clustered",
        "theta",
        "initial",
        "demonstrated",
        "expected",
        "metrics",
    ),
}
#: Keys that come from the data: names of metrics and of parameters, which have their unit beside them.
NAMES = {metric.name for metric in METRICS} | {parameter.name for parameter in parameters_of(TERMS.values())}


def has_unit(key):
    return any(key == unit or key.endswith(f"_{unit}") for unit in UNITS)


def follows(key):
    return has_unit(key) or any(name in key for name in NATS) or key in WITHOUT | TIMES_NS | STATISTICS | NAMES


def resolved(schema, root):
    while "$ref" in schema:
        target = root
        for name in schema["$ref"].removeprefix("#/").split("/"):
            target = target[name]
        schema = target
    return schema


def holds_numbers(schema, root):
    schema = resolved(schema, root)
    types = [schema["type"]] if isinstance(schema.get("type"), str) else schema.get("type", [])
    if {"number", "integer"} & set(types):
        return True
    return any(
        holds_numbers(one, root) for one in (schema.get("items"), *schema.get("oneOf", ())) if isinstance(one, dict)
    )


def numeric_keys(schema, root, around=""):
    """The keys of all numbers that a schema allows; of names from the data, the key around them."""
    for key, one in schema.get("properties", {}).items():
        if holds_numbers(one, root):
            yield key
        yield from numeric_keys(one, root, key)
    named = schema.get("additionalProperties")
    if isinstance(named, dict):
        if holds_numbers(named, root):
            yield around
        yield from numeric_keys(named, root, around)
    for one in (schema.get("items"), *schema.get("oneOf", ())):
        if isinstance(one, dict):
            yield from numeric_keys(one, root, around)
    for key, one in schema.get("$defs", {}).items():
        yield from numeric_keys(one, root, key)


def leaves(value, way=()):
    if isinstance(value, dict):
        for key, one in value.items():
            yield from leaves(one, (*way, key))
    elif isinstance(value, list):
        for one in value:
            yield from leaves(one, way)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield way


def wrong_keys(document, data=()):
    """Numbers whose key does not follow the rule; below a key in ``data`` stand names from the data."""
    return {way for way in leaves(document) if not (follows(way[-1]) or any(key in data for key in way[:-1]))}


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_of_schemas_have_their_unit_in_their_key(kind):
    schema = json.loads(schema_path(kind).read_text())
    names = {"missing", "by_parameter", "values", "metrics", "number"}  # definitions, and numbers of demonstrations
    assert {key for key in numeric_keys(schema, schema) if not (follows(key) or key in names)} == set()


@pytest.mark.parametrize("kind", FIRST)
def test_numbers_of_files_have_their_unit_in_their_key(kind):
    document = read_json(ROOT / "tests" / "version1" / f"{kind}.json", kind)
    assert wrong_keys(document, {"by_participant", "completion_s", "missing"}) == set()


def test_numbers_of_metrics_have_their_unit_in_their_name():
    units = {"1": "", "1/m": "1_m", "m²": "m2", "m/s": "m_s", "m/s²": "m_s2", "m/s³": "m_s3", "N s": "n_s"}
    for metric in METRICS:
        unit = units.get(metric.unit, metric.unit.lower())
        assert metric.name.endswith(f"_{unit}" if unit else ("_share", "compliance", "_intrusions")), metric.name


def test_numbers_of_what_commands_print_have_their_unit_in_their_key(navirl, tmp_path):
    log = ROOT / "sample_logs" / "p01.mcap"
    (tmp_path / "runs" / "p1").mkdir(parents=True)
    for name, data in forge.participant().items():
        (tmp_path / "runs" / "p1" / name).write_bytes(data)
    (tmp_path / "trials.csv").write_text(navirl("inspect", log, "--trials").stdout)
    for words, data in (
        (("inspect", log), ()),
        (("extract", log, "-o", "demos.json"), ()),
        (("inspect", log, "--trials"), ()),
        (("annotate", log, "trials.csv", "-o", "copy.mcap"), ()),
        (("extract", log, "-o", "gain.json", "--gain"), ()),
        (("import-study", "runs", "-o", "logs"), {"completion_s"}),
    ):
        printed = json.loads(navirl(*words, "--json").stdout)
        assert list(leaves(printed)) != []
        assert wrong_keys(printed, data) == set(), words


def test_keys_that_break_the_rule_are_seen():
    broken = {"duration s": 1, "contact %": 5.0, "impulse_ns": [[1]], "peak": {"name": [2.0]}, "length_m": 1, "x": "a"}
    assert wrong_keys(broken) == {
        ("duration s",),
        ("contact %",),
        ("impulse_ns",),
        ("peak", "name"),
    }
