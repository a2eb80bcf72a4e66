"""What navirl writes, it reads back; what breaks a schema is refused with the place."""

import json
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from robot_log import Run, write_run

from navirl_cli.artefacts.demonstrations import demonstrations_document, gain_document, read_demonstrations
from navirl_cli.artefacts.rewards import Analyses, read_reward, read_reward_for, reward_document
from navirl_cli.artefacts.store import read_json, schema_path, write_json
from navirl_cli.demos.demonstration import PersonTrack
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.demos.gain import Gain
from navirl_cli.errors import ArtefactError
from navirl_cli.files import Input
from navirl_cli.irl.bootstrap import Bootstrap
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.profile import Profile
from navirl_cli.irl.reward import Reward
from navirl_cli.logs.load import load_recording


@pytest.fixture(scope="module")
def demonstration(tmp_path_factory):
    path = write_run(tmp_path_factory.mktemp("log") / "run.mcap", Run(obstacles=((30, 17), (5, 5))))
    return extract(load_recording(path), ExtractSettings()).demonstrations[0]


@pytest.fixture
def demos(tmp_path, demonstration):
    path = tmp_path / "demos.json"
    walker = PersonTrack("ann", np.array([0.1, 0.3, 1.7]), np.array([[2.0, 0.5], [2.0, 0.7], [2.1, 1.3]]))
    sitter = PersonTrack("bob", np.zeros(0), np.zeros((0, 2)))
    watched = replace(demonstration, people_m=np.array([[2.0, 0.9], [1.0, 1.0]]), tracks=(walker, sitter))
    two = [watched, replace(demonstration, id="run/2", force_n=None, cycle=2, people_m=np.zeros((0, 2)))]
    write_json(path, "demonstrations", demonstrations_document(two, [Input("run.mcap", "0" * 64)], {}), force=False)
    return path, two


def edited(path: Path, change) -> Path:
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("kind", ["demonstrations", "reward", "metrics"])
def test_schemas_are_schemas(kind):
    Draft202012Validator.check_schema(json.loads(schema_path(kind).read_text()))


def test_demonstrations_come_back_as_they_were(demos):
    path, written = demos
    for d, back in zip(written, read_demonstrations(path), strict=True):
        for field in fields(d):
            old, new = getattr(d, field.name), getattr(back, field.name)
            if field.name == "grid":
                assert new.digest == old.digest
            elif field.name == "contacts":
                assert [c.impulse_n_s for c in new] == [pytest.approx(c.impulse_n_s, abs=1e-6) for c in old]
            elif field.name == "tracks":
                assert [track.name for track in new] == [track.name for track in old]
                for track, was in zip(new, old, strict=True):
                    assert (track.t_s == was.t_s).all()
                    assert track.xy_m == pytest.approx(was.xy_m)
            elif isinstance(old, np.ndarray):
                assert new == pytest.approx(old, abs=1e-6)
            else:
                assert new == old


def test_a_file_holds_how_far_people_moved(demos):
    path, (watched, _) = demos
    ann, bob = read_json(path, "demonstrations")["demonstrations"][0]["tracks"]
    assert ann["spread_m"] == pytest.approx(watched.tracks[0].spread_m, abs=1e-6)
    assert (bob["spread_m"], bob["t_s"]) == (0.0, [])


def test_a_file_without_tracks_and_gain_is_read_as_before(demos):
    path, _ = demos
    first, second = read_demonstrations(edited(path, lambda d: [one.pop("tracks") for one in d["demonstrations"]]))
    assert first.tracks == second.tracks == ()
    assert len(first.people_m) == 2


def test_gains_are_written_by_log_and_together(demos):
    path, _ = demos
    found = gain_document(
        [("a.mcap", Gain(0.015, 0.001, 4, 0.1)), ("b.mcap", None), ("c.mcap", Gain(0.017, 0.001, 3, 0.0))]
    )
    assert [one["log"] for one in found["logs"]] == ["a.mcap", "c.mcap"]
    assert (found["gain_m_s_n"], found["pushes"]) == (pytest.approx(0.016), 7)
    assert gain_document([("b.mcap", None)]) is None
    for gain in (found, None):
        assert read_json(edited(path, lambda d, gain=gain: d.update(gain=gain)), "demonstrations")["gain"] == gain
    with pytest.raises(ArtefactError, match="breaks the schema of navirl demonstrations at gain"):
        read_demonstrations(edited(path, lambda d: d.update(gain={**found, "pushes": 0})))


def test_a_reward_comes_back_with_its_covariance(tmp_path, demonstration):
    result = fit(evidence_of([demonstration]), Reward.named({}))
    path = tmp_path / "reward.json"
    write_json(path, "reward", reward_document(result, [demonstration], [], 0.1), force=False)
    back = read_reward(path)
    assert back.reward == result.reward
    assert back.covariance == pytest.approx(result.covariance, nan_ok=True)
    assert (back.resolution_m, back.demonstrations) == (0.1, ("run/1",))
    document = read_json(path, "reward")
    assert document["initial"] == {"c0": -50.0, "a_g": -0.01, "a_p": -5.0, "sigma_p": 2.0}
    coarse = extract_coarse(demonstration)
    with pytest.raises(
        ArtefactError, match=r"learnt on cells of 0\.1 m, but .* cells of 0\.2 m; extract .* `resolution` 0\.1"
    ):
        read_reward_for(path, [coarse])


def extract_coarse(demonstration):
    return replace(
        demonstration,
        grid=demonstration.grid.resampled(0.2).freed(np.array([[1, 1], [2, 1]])),
        cells=np.array([[1, 1], [2, 1]]),
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda d: d["demonstrations"][1].update(id="run/1"),
            "two demonstrations are called run/1; ids must be unique",
        ),
        (lambda d: d["demonstrations"][0]["cells"].__setitem__(3, [10**30, 1]), "demonstration run/1: .*too large"),
        (lambda d: d["demonstrations"][0].update(robot_radius_m=float("nan")), "found none .NaN is no JSON number"),
        (lambda d: d.pop("maps"), "at the whole file: expected the field 'maps', which is missing"),
        (lambda d: d.update(version=0), "version: expected 1 to 2, found 0; later"),
        (lambda d: d.update(extra=1), "at the whole file: expected no field 'extra', which the format"),
        (
            lambda d: d["demonstrations"][0].update(condition="push"),
            "at demonstrations/0/condition: expected one of 'force'",
        ),
        (lambda d: d["demonstrations"][1].update(goal_m=[1]), "at demonstrations/1/goal_m: expected a list of 2"),
        (lambda d: d["demonstrations"][0].update(map="x"), "demonstration run/1: its map 'x' is not in the file"),
        (lambda d: d["demonstrations"][0]["x_m"].pop(), "demonstration run/1: all input arrays must have the same"),
        (lambda d: d["demonstrations"][0]["yaw_rad"].pop(), r"demonstration run/1: yaw_rad needs the shape"),
        (lambda d: d["demonstrations"][0]["t_s"].reverse(), "demonstration run/1: needs at least two poses at incr"),
        (lambda d: d["demonstrations"][0]["x_m"].__setitem__(3, "a"), "demonstration run/1: could not convert"),
        (lambda d: d["demonstrations"][0]["x_m"].__setitem__(3, None), "demonstration run/1: xy_m holds values that"),
        (lambda d: d["demonstrations"][0]["cells"].pop(3), "demonstration run/1: step 2 of its path does not lead"),
        (lambda d: d["demonstrations"][0]["tracks"].pop(), "run/1: needs a track for each of its 2 people, found 1"),
        (lambda d: d["demonstrations"][0]["tracks"][0]["t_s"].pop(), "run/1: track of person ann: t_s and xy_m need"),
        (
            lambda d: d["demonstrations"][0]["tracks"][0]["x_m"].pop(),
            "run/1: all input arrays must have the same shape",
        ),
        (lambda d: d["demonstrations"][0]["tracks"][0].update(x_m=["a"] * 3), "run/1: could not convert"),
        (
            lambda d: d["demonstrations"][0]["tracks"][0].pop("name"),
            "at demonstrations/0/tracks/0: expected the field 'n",
        ),
        (lambda d: next(iter(d["maps"].values()))["rows"].append("#"), "a map's rows differ in length"),
        (
            lambda d: next(iter(d["maps"].values())).update(resolution_m=-1),
            "resolution_m: expected 0.001 or more, found -1",
        ),
    ],
)
def test_broken_demonstrations_are_refused_with_the_place(demos, change, message):
    path, _ = demos
    with pytest.raises(ArtefactError, match=message) as caught:
        read_demonstrations(edited(path, change))
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda d: d["t_s"].__setitem__(-1, 1e300),
            r"run/1: t_s: expected numbers from -1e\+06 to 1e\+06, found 1e\+300",
        ),
        (
            lambda d: d["x_m"].__setitem__(3, -1e150),
            r"run/1: x_m: expected numbers from -\d+\.\d+ to .*, found -1e\+150",
        ),
        (lambda d: d["y_m"].__setitem__(3, -(2**63)), r"run/1: y_m: expected numbers from .*, found -9\.22337e\+18"),
        (lambda d: d["x_m"].__setitem__(3, 10**400), r"run/1: int too large to convert to float"),
        (lambda d: d["yaw_rad"].__setitem__(3, 1e7), r"run/1: yaw_rad: expected numbers from -1e\+06 to"),
        (lambda d: d["force_x_n"].__setitem__(3, 1e7), r"run/1: force_x_n: expected numbers from -1e\+06 to"),
        (lambda d: d["tracks"][0]["x_m"].__setitem__(1, 1e9), r"run/1: x_m: expected numbers from -1e\+08 to"),
        (lambda d: d["contacts"][0].update(start_s=10**400), "contacts/0/start_s: expected a number, found 1000"),
        (lambda d: d["people_m"][0].__setitem__(1, 1e308), r"people_m/0/1: expected 1e\+08 or less, found 1e\+308"),
        (lambda d: d.update(robot_radius_m=1e300), r"robot_radius_m: expected 10 or less, found 1e\+300"),
        (lambda d: d.update(start_ns=2**63), "start_ns: expected 9.22337e"),
        (
            lambda d: d.update(set="\ud800"),
            r"expected a JSON file of .*, found none \(\\ud800, half of a surrogate pair, which no text has; write",
        ),
    ],
)
def test_numbers_and_texts_that_no_trial_holds_are_refused(demos, change, message):
    path, _ = demos
    with pytest.raises(ArtefactError, match=message):
        read_demonstrations(edited(path, lambda d: change(d["demonstrations"][0])))


def test_an_escaped_character_outside_the_basic_plane_is_read(demos):
    path, _ = demos
    edited(path, lambda d: d["demonstrations"][0].update(participant="p \N{ROBOT FACE} é"))
    assert "\\ud83e" in path.read_text()
    assert read_demonstrations(path)[0].participant == "p \N{ROBOT FACE} é"


def test_a_path_through_an_occupied_cell_is_refused(demos):
    path, _ = demos

    def block(document):
        first = document["demonstrations"][0]
        column, row = first["cells"][10]
        rows = document["maps"][first["map"]]["rows"]
        rows[row] = rows[row][:column] + "#" + rows[row][column + 1 :]

    with pytest.raises(ArtefactError, match="demonstration run/1: its path crosses occupied cells"):
        read_demonstrations(edited(path, block))


def test_other_files_are_refused_by_what_they_are(tmp_path):
    for content, message in (
        ("", "expected a JSON file of navirl demonstrations, found none"),
        ("[]", "expected navirl demonstrations (format 'navirl/demonstrations'), found other JSON"),
        ('{"format": "navirl/reward"}', "found a file of format 'navirl/reward'"),
        ('{"format": ' + "[" * 900 + "]" * 900 + "}", "found other JSON"),
        ("[" * 100_000, "expected a JSON file of navirl demonstrations, found none"),
    ):
        path = tmp_path / "x.json"
        path.write_text(content)
        with pytest.raises(ArtefactError, match=re.escape(message)):
            read_demonstrations(path)
    log = tmp_path / "run.mcap"
    log.write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(
        ArtefactError,
        match=r"run\.mcap: expected a JSON file .* found an MCAP log; navirl extract makes demonstrations",
    ):
        read_demonstrations(log)
    with pytest.raises(ArtefactError, match=r"none\.json: cannot be read: No such file"):
        read_demonstrations(tmp_path / "none.json")


def test_a_reward_of_other_parameters_is_refused(tmp_path, demonstration):
    path = tmp_path / "reward.json"
    result = fit(evidence_of([demonstration]), Reward.named({}))
    write_json(path, "reward", reward_document(result, [demonstration], [], 0.1), force=False)
    edited(path, lambda d: d["parameters"][0].update(name="c9"))
    with pytest.raises(ArtefactError, match=r"expected c0, a_g, a_p, sigma_p, as of the terms .*, found c9, a_g"):
        read_reward(path)
    edited(path, lambda d: d["parameters"].append({**d["parameters"][0], "name": "c0"}))
    with pytest.raises(ArtefactError, match="found c9, a_g, a_p, sigma_p, c0"):
        read_reward(path)
    edited(path, lambda d: (d["parameters"].pop(), d["parameters"][0].update(name="c0"), d["parameters"].reverse()))
    with pytest.raises(ArtefactError, match="found sigma_p, a_p, a_g, c0"):  # whose rows are whose, one cannot know
        read_reward(path)
    edited(path, lambda d: (d["parameters"].reverse(), d["parameters"][0].update(value=5.0)))
    with pytest.raises(ArtefactError, match="c0 = 5 1/m is outside its bounds"):
        read_reward(path)
    edited(path, lambda d: (d["parameters"][0].update(value=-50.0), d["covariance"].pop()))
    with pytest.raises(ArtefactError, match="covariance: expected 4 rows of 4 numbers"):
        read_reward(path)


def test_files_appear_complete_or_not_at_all(tmp_path):
    path = tmp_path / "x.json"
    write_json(path, "metrics", {"a": 1}, force=False)
    old = path.read_text()
    with pytest.raises(
        ArtefactError, match=r"x\.json: exists already; choose another name, or replace it with `force`"
    ):
        write_json(path, "metrics", {"a": 2}, force=False)
    with pytest.raises(ValueError, match="Out of range float"):
        write_json(path, "metrics", {"a": float("nan")}, force=True)
    assert path.read_text() == old
    assert [item.name for item in tmp_path.iterdir()] == ["x.json"]
    with pytest.raises(ArtefactError, match="expected an existing folder, found none"):
        write_json(tmp_path / "no" / "x.json", "metrics", {}, force=False)
    with pytest.raises(ArtefactError, match="found a folder; name a file in it"):
        write_json(tmp_path, "metrics", {}, force=True)


def test_inputs_are_hashed(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    assert Input.of(path).sha256.startswith("ba7816bf8f01cfea")
    with pytest.raises(ArtefactError, match="cannot be read"):
        Input.of(tmp_path / "b")


@pytest.fixture
def with_profile(tmp_path, demonstration):
    """A reward file with a profile and a bootstrap, forged: what its numbers are does not matter here."""
    result = fit(evidence_of([demonstration]), Reward.named({}))
    values = np.array([1.0, 2.0, 3.5])
    profile = Profile("c0", values, np.array([-2.0, 0.0, -2.5]), np.ones((3, 4)), 0.95, 1.1, None)
    drawn = Bootstrap(
        np.arange(8.0).reshape(2, 4),
        failed=1,
        stopped_early=0,
        seed=9,
        estimate=np.ones(4),
        without_one=np.ones((2, 4)),
    )
    path = tmp_path / "reward.json"
    document = reward_document(result, [demonstration], [], 0.1, Analyses(bootstrap=drawn, profiles=(profile,)))
    write_json(path, "reward", document, force=False)
    return path, profile


def test_profiles_and_bootstraps_come_back(with_profile):
    path, profile = with_profile
    (back,) = read_reward(path).profiles
    for field in fields(profile):
        old, new = getattr(profile, field.name), getattr(back, field.name)
        assert (np.asarray(old) == np.asarray(new)).all(), field.name
    drawn = read_json(path, "reward")["bootstrap"]
    assert (drawn["theta"], drawn["failed"], drawn["seed"]) == ([[0, 1, 2, 3], [4, 5, 6, 7]], 1, 9)
    assert drawn["standard_errors"] == pytest.approx([np.sqrt(8)] * 4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p["values"].pop(), "the profile of c0 needs ascending values"),
        (lambda p: p["relative_log_likelihood"].append(0.0), "the profile of c0 needs ascending values"),
        (lambda p: p["theta"].pop(), "the profile of c0 needs ascending values"),
        (
            lambda p: [p[key].clear() for key in ("values", "relative_log_likelihood", "theta")],
            "needs ascending values",
        ),
        (lambda p: p.update(level=1.0), "breaks the schema of navirl reward at profiles/0/level"),
        (lambda p: p.pop("upper"), "breaks the schema of navirl reward at profiles/0: expected the field 'upper'"),
    ],
)
def test_broken_profiles_are_refused(with_profile, change, message):
    path, _ = with_profile
    with pytest.raises(ArtefactError, match=message) as caught:
        read_reward(edited(path, lambda document: change(document["profiles"][0])))
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    "lines", [lambda d: d["covariance"], lambda d: d["profiles"][0]["theta"]], ids=["covariance", "profile"]
)
def test_rows_of_different_lengths_are_refused(with_profile, lines):
    path, _ = with_profile
    with pytest.raises(ArtefactError):
        read_reward(edited(path, lambda document: lines(document)[0].pop()))


@pytest.mark.parametrize(
    "change",
    [lambda p: p["values"].__setitem__(1, None), lambda p: p["values"].reverse(), lambda p: p.update(parameter="c9")],
    ids=["no number", "not ascending", "of no parameter"],
)
def test_contradictory_profiles_are_refused(with_profile, change):
    path, _ = with_profile
    with pytest.raises(ArtefactError, match="profile"):
        read_reward(edited(path, lambda document: change(document["profiles"][0])))
