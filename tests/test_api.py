"""The Python door: its names, its agreement with the command line, its errors, and what a notebook user does."""

import json
import subprocess
import sys
from inspect import Parameter, signature
from pathlib import Path

import click
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

import navirl_cli as navirl
from navirl_cli.api import plot
from navirl_cli.api.frames import frame_of
from navirl_cli.cli import cli

ROOT = Path(__file__).parent.parent
LOGS = [str(ROOT / "sample_logs" / f"p0{k}.mcap") for k in (1, 2)]
#: Options that make no sense in Python: where results go and how they are printed.
OF_THE_SHELL = {"output", "force", "json", "format", "list_metrics", "help", "list"}


@pytest.fixture(scope="module")
def demos():
    return navirl.extract(*LOGS)


@pytest.fixture(scope="module")
def reward(demos):
    return navirl.fit(demos, condition="force", cycle=2, intervals="wald", profile="sigma_p")


@pytest.fixture(name="shell")
def _shell(request):
    """Run the command line in an empty folder."""
    return request.getfixturevalue("navirl")


@pytest.fixture(autouse=True)
def no_display():
    yield
    plt.close("all")


def code_of(text, **options):
    return subprocess.run([sys.executable, "-c", text], check=True, capture_output=True, text=True, **options).stdout


class TestNames:
    def test_ten_at_most_and_all_there(self):
        assert len(navirl.__all__) <= 10
        assert set(navirl.__all__) <= set(dir(navirl))
        for name in navirl.__all__:
            assert getattr(navirl, name).__doc__, name

    def test_an_unknown_name_is_an_attribute_error(self):
        with pytest.raises(AttributeError, match=r"has no attribute 'extracts'; it has .*extract"):
            navirl.extracts  # noqa: B018

    def test_the_import_loads_nothing_heavy(self):
        loaded = code_of("import sys, navirl_cli; print(*sys.modules)").split()
        assert not {"numpy", "scipy", "matplotlib", "click", "navirl_cli.api"} & set(loaded)

    def test_types_ship(self):
        assert (Path(navirl.__file__).parent / "py.typed").exists()

    def test_a_user_sees_types(self, tmp_path):
        pytest.importorskip("mypy")
        (tmp_path / "use.py").write_text(
            "import navirl_cli as navirl\n"
            "demos = navirl.extract('a.mcap')\n"
            "reward = navirl.fit(demos, condition='force', cycle=2)\n"
            "reveal_type(navirl.policy(reward, demos[0]).visits)\n"
            "reveal_type(navirl.plot.policy(reward, demos[0]))\n"
            "navirl.fit(demos, cycles=2)\n"
        )
        # in the project, for its settings and its cache
        words = [sys.executable, "-m", "mypy", str(tmp_path / "use.py")]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False).stdout
        assert "numpy.ndarray[" in done
        assert '"matplotlib.axes._axes.Axes"' in done
        assert 'Unexpected keyword argument "cycles" for "fit"' in done


def options_of(*path):
    """The options of a command by name, with their defaults."""
    command, context = cli, click.Context(cli)
    for name in path:
        command = command.get_command(context, name)
    found = {}
    for one in command.params:
        if isinstance(one, click.Option):
            name = max(one.opts, key=len).removeprefix("--").replace("-", "_")
            if name not in OF_THE_SHELL:
                found[name] = one
    return found


def plain(value):
    """A default of either side, so that both can be compared: nothing, no flag and no choice are alike."""
    nothing = "UNSET" in repr(value).upper() or value in (None, False, "", (), [])
    return None if nothing else getattr(value, "value", value)


@pytest.mark.parametrize(
    ("function", "path"),
    [
        (navirl.extract, ("extract",)),
        (navirl.inspect, ("inspect",)),
        (navirl.fit, ("fit",)),
        (navirl.evaluate, ("evaluate",)),
        *[(getattr(plot, name), ("plot", name)) for name in plot.__all__],
    ],
)
def test_keywords_are_the_options_with_their_defaults(function, path):
    keywords = {
        name: one for name, one in signature(function).parameters.items() if one.kind is not Parameter.VAR_POSITIONAL
    }
    options = options_of(*path)
    beyond = {"executor", "axes", "page", "demos", "demonstration", "reward", "name"}
    # `name` of plot.profile is one --parameter
    of_the_shell = {"parameter", "wide", "style", "font", "group", "reward"}
    of_the_shell |= {"trial"} if "trial" not in keywords else set()
    if "demonstration" in keywords:  # which demonstrations.select chooses
        of_the_shell |= {"condition", "cycle", "set", "participant", "all"}
    # the table of trials is a file to fill in
    table = {"trials", "split", "goal", "frame"} if path == ("inspect",) else set()
    missing = set(options) - set(keywords) - of_the_shell - table
    assert not missing, "options that Python lacks"
    assert set(keywords) - set(options) <= beyond
    for name in set(keywords) & set(options) - {"metrics", "reward"}:
        assert plain(keywords[name].default) == plain(options[name].default), name


class TestResults:
    def test_demonstrations_are_those_of_the_command(self, demos, shell):
        shell("extract", *LOGS, "-o", "demos.json")
        demos.write("own.json")
        written, own = (json.loads(Path(name).read_text()) for name in ("demos.json", "own.json"))
        assert own == written
        assert [one.id for one in demos[7:9]] == ["p02/1", "p02/2"]
        assert "p01/1" in repr(demos)
        again = navirl.read_demonstrations("demos.json")
        assert all(np.array_equal(one.xy_m, other.xy_m) for one, other in zip(demos, again, strict=True))
        again.write("again.json")
        assert json.loads(Path("again.json").read_text()) == written

    def test_a_reward_is_that_of_the_command(self, demos, shell):
        demos.write("demos.json")
        shell("fit", "demos.json", "--condition", "force", "--cycle", "2", "-o", "reward.json")
        found = navirl.fit("demos.json", condition="force", cycle=2)
        found.write("own.json")
        assert Path("own.json").read_bytes() == Path("reward.json").read_bytes()
        again = navirl.read_reward("reward.json")
        assert again["c0"] == found["c0"] == found.reward.theta[0]
        assert "sigma_p" in repr(again)
        assert "sigma_p" in repr(found)
        again.write("again.json")
        assert Path("again.json").read_bytes() == Path("reward.json").read_bytes()

    def test_metrics_are_those_of_the_command(self, demos, reward, shell):
        demos.write("demos.json")
        reward.write("learnt.json")
        shell("evaluate", "demos.json", "--reward", "learnt.json", "-o", "metrics.json")
        navirl.evaluate("demos.json", "learnt.json").write("own.json")
        assert json.loads(Path("own.json").read_text()) == json.loads(Path("metrics.json").read_text())
        found = navirl.evaluate(demos, {"one": reward, "other": {"c0": -40.0}}, metrics="length_m", samples=10)
        assert {row["path_type"] for row in found.document["groups"]} >= {"learnt, one", "learnt, other"}
        assert "learnt, other" in repr(found)
        found.write("metrics.csv")
        assert Path("metrics.csv").read_text().startswith("group,path_type,n,length_m")

    def test_demonstrations_are_chosen_as_on_the_command_line(self, demos, reward):
        some = demos.select(cycle=2, participant=["p01", "p02"])
        assert [one.id for one in some] == ["p01/3", "p01/4", "p02/3", "p02/4"]
        assert some.sources() == demos.sources()
        with pytest.raises(navirl.NavirlError, match=r"`cycle`: expected one of '1', .* found '9'"):
            demos.select(cycle=9)
        found = navirl.evaluate(demos, reward, metrics="length_m", samples=5)
        assert {one["id"] for one in found.document["demonstrations"]} == set(reward.demonstrations)
        assert "those that the reward was learnt from; `all` takes the others too" in repr(found)
        days = navirl.evaluate({"one": some, "other": demos}, metrics="length_m", quantiles=0.5, cycle=2)
        assert days.document["pairs"][0]["minus"] == "one: force, cycle 2"
        assert {one["share"] for one in days.document["quantiles"]} == {0.5}

    def test_a_policy_lies_on_its_grid(self, demos, reward):
        where = navirl.policy(reward, demos[0])
        free = np.isfinite(where.visits)
        assert where.visits.shape == where.value.shape == where.state_reward.shape == where.grid.shape
        assert not where.grid.occupied[free].any()
        column, row = demos[0].cells[-1]
        assert where.visits[row, column] == pytest.approx(1.0), "all paths end in the goal"
        assert np.nansum(where.probability, axis=2)[free].max() == pytest.approx(1.0)
        paths = where.sample(5, seed=3)
        assert np.array_equal(paths[0], where.sample(5, seed=3)[0])
        assert np.allclose(paths[0][-1], where.grid.centres_of(demos[0].cells[-1]))
        assert navirl.policy({"c0": -60.0}, demos[0]).reward.theta[0] == -60.0

    def test_inspect_sees_what_extract_takes(self):
        (view,) = navirl.inspect(LOGS[0])
        assert view.needed == ()
        assert view.choices["wrench"].topics[0].name == "/wrench"


class TestFrames:
    def test_frames_hold_the_numbers(self, demos, reward):
        pytest.importorskip("pandas")
        assert len(demos.to_frame()) == len(demos)
        assert list(reward.to_frame()["name"]) == ["c0", "a_g", "a_p", "sigma_p"]
        found = navirl.evaluate(demos, reward, all=True, pair=("force, cycle 2", "joystick"), ranks=True, samples=20)
        groups = found.to_frame()
        assert groups.loc[groups["path_type"] == "driven", "length_m_mean"].notna().all()
        assert len(found.to_frame("demonstrations")) == len(demos)
        assert list(found.to_frame("pairs")["metric"]) == ["length_m", "min_distance_m", "area_m2"]
        assert found.to_frame("ranks")["rank"].between(0, 1).all()
        with pytest.raises(navirl.NavirlError, match="expected one of 'groups', 'demonstrations', 'pairs', 'ranks'"):
            found.to_frame("rank")

    def test_without_pandas_the_error_gives_the_install_command(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "pandas", None)
        with pytest.raises(navirl.NavirlError, match="pip install pandas"):
            frame_of([])


class TestPlots:
    def test_each_returns_axes_with_something_on_them(self, demos, reward):
        one = demos[2]
        drawn = [
            navirl.plot.paths(demos),
            *(getattr(navirl.plot, name)(reward, one) for name in ("policy", "reward", "value", "actions")),
            *navirl.plot.properties(demos, reward, samples=10),
            *navirl.plot.forces(one),
            *navirl.plot.ranks(demos, reward, samples=10),
            *navirl.plot.convergence(reward),
            navirl.plot.profile(reward, "sigma_p"),
        ]
        for axes in drawn:
            assert isinstance(axes, Axes)
            assert axes.has_data()

    def test_own_axes_are_drawn_on_and_own_settings_stay(self, demos, reward):
        plt.rcParams["font.size"] = 17
        _, axes = plt.subplots()
        assert navirl.plot.policy(reward, demos[0], axes=axes, overlay=["demos", "samples"], crop=True) is axes
        assert plt.rcParams["font.size"] == 17
        plt.rcdefaults()

    def test_a_new_figure_is_shown_by_pyplot_and_a_written_one_is_not(self, demos, reward, tmp_path):
        shown = navirl.plot.policy(reward, demos[0])
        assert shown.figure.number in plt.get_fignums()
        before = plt.get_fignums()
        navirl.plot.policy(reward, demos[0], output=tmp_path / "policy.pdf", wide=True, style="dark")
        assert (tmp_path / "policy.pdf").read_bytes().startswith(b"%PDF")
        assert plt.get_fignums() == before
        with pytest.raises(navirl.NavirlError, match="exists already"):
            navirl.plot.policy(reward, demos[0], output=tmp_path / "policy.pdf")


class TestErrors:
    @pytest.mark.parametrize(
        ("call", "message"),
        [
            (lambda _d, _r: navirl.extract(), "`logs`: expected at least one log"),
            (lambda _d, _r: navirl.extract("none.mcap"), r"none\.mcap"),
            (
                lambda _d, _r: navirl.extract(LOGS[0], split="goals"),
                "`split`: expected one of 'goal', 'stop', 'none', found 'goals'",
            ),
            (lambda _d, _r: navirl.extract(LOGS[0], resolution=0), "`resolution`: expected a number from 0.01 to 2"),
            (lambda _d, _r: navirl.extract(LOGS[0], contact_force=0), "`contact_force`: expected a number above 0"),
            (lambda _d, _r: navirl.extract(LOGS[0], person=(1, 2, 3)), r"expected points as \(x, y\) in m"),
            (
                lambda _d, _r: navirl.extract(LOGS[0], no_wrench=True, gain=True),
                "`no_wrench` leaves out .*: leave out `gain`, or `no",
            ),
            (lambda _d, _r: navirl.inspect(), "`logs`: expected at least one log"),
            (
                lambda d, _r: navirl.fit(d, condition="push"),
                "`condition`: expected one of 'force', 'joystick', 'autonomous'",
            ),
            (lambda d, _r: navirl.fit(d, cross_validate="trial"), "`cross_validate`: expected 'participant'"),
            (
                lambda d, _r: navirl.fit(d, correct_bias=True, bootstrap=5),
                "`correct_bias` changes the values, .*: leave out `bootstrap`, or ask",
            ),
            (lambda d, _r: navirl.fit(d, l2=-1), "`l2`: expected a number from 0"),
            (lambda _d, _r: navirl.fit([]), "`demos`: expected at least one demonstration"),
            (lambda d, r: navirl.evaluate(d, r, metrics="length"), "`metrics`: expected one of 'length_m', "),
            (lambda d, _r: navirl.evaluate(d, ranks=True), "`ranks` needs one `reward`"),
            (lambda d, r: navirl.evaluate(d, r, pair="force"), "`pair`: expected two names of groups"),
            (lambda d, _r: navirl.policy({"c1": 0.0}, d[0]), "c1"),
            (lambda _d, r: r["c1"], "parameter: expected one of 'c0', 'a_g', 'a_p', 'sigma_p', found 'c1'"),
            (
                lambda d, r: navirl.plot.policy(r, d[0], overlay="paths"),
                "`overlay`: expected one of 'demos', 'all', 'samples'",
            ),
            (
                lambda d, r: navirl.plot.policy(r, d[0], style="grey"),
                "`style`: expected one of 'paper', 'screen', 'dark'",
            ),
            (lambda _d, r: navirl.plot.profile(r, "c0"), r"profile likelihood \(sigma_p\), found 'c0'"),
        ],
    )
    def test_expected_errors_are_one_type_and_name_the_argument(self, demos, reward, call, message):
        with pytest.raises(navirl.NavirlError, match=message):
            call(demos, reward)

    def test_lost_data_gives_a_warning_at_the_line_of_the_call(self, tmp_path):
        (tmp_path / "broken.mcap").write_bytes(b"no log at all")
        with pytest.warns(navirl.NavirlWarning, match=r"broken\.mcap") as caught:
            found = navirl.extract(LOGS[0], tmp_path / "broken.mcap")
        assert caught[0].filename == __file__
        assert len(found.lost) == 1

    def test_a_fit_that_did_not_converge_gives_a_warning(self, demos):
        with pytest.warns(navirl.NavirlWarning, match="fit: ") as caught:
            found = navirl.fit([one for one in demos if one.id == "p01/7"], l2=0.0)
        assert found.status.value in str(caught[0].message)
        assert caught[0].filename == __file__
