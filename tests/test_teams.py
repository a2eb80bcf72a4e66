"""Workers that keep parts of data, and sums over scenes that do not depend on them."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from factories import drawn, random_scene
from hypothesis import given
from hypothesis import strategies as st
from jobs import ending, signed

from navirl_cli.errors import WorkerLostError
from navirl_cli.irl import evidence as evidence_room
from navirl_cli.irl.evidence import Evidence, evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import (
    feature_sums,
    likelihood,
    log_likelihood,
    path_covariance,
    step_likelihood,
    value_and_gradient,
)
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.parallel import Local
from navirl_cli.teams import divided, team

REWARD = Reward((-50.0, -0.5, -4.0, 1.5))


@given(st.lists(st.integers(1, 50), max_size=40), st.integers(1, 9))
def test_parts_are_divided_in_their_order(sizes, count):
    parts = list(range(len(sizes)))
    runs = divided(parts, sizes, count)
    assert [part for run in runs for part in run] == parts
    assert len(runs) <= count
    assert all(sum(sizes[part] for part in run) <= sum(sizes) / count + max(sizes) for run in runs)


def test_each_process_keeps_its_parts():
    with team(Local(3), signed, range(7), [1.0] * 7) as ask:
        found = [ask((None, None)) for _ in range(3)]
    assert [part for part, _ in found[0]] == list(range(7))
    assert found[0] == found[1] == found[2]
    assert len({process for _, process in found[0]}) == 3


def test_the_first_part_that_fails_is_named_and_the_team_goes_on():
    with team(Local(2), signed, range(4), [1.0] * 4) as ask:
        for part in (3, 0):
            with pytest.raises(ValueError, match=f"part {part}"):
                ask((part, None))
        assert [part for part, _ in ask((None, None))] == [0, 1, 2, 3]


def test_a_killed_process_is_replaced_once(tmp_path):
    with team(Local(2), signed, range(7), [1.0] * 7) as ask:
        before = ask((None, None))
        after = ask((None, tmp_path / "killed"))
        assert [part for part, _ in after] == [part for part, _ in before]
        assert not {process for _, process in after} & {process for _, process in before}
    with team(Local(2), ending, range(7), [1.0] * 7) as ask, pytest.raises(WorkerLostError, match="fewer `workers`"):
        ask(None)


def test_one_worker_or_others_keep_nothing():
    with ThreadPoolExecutor(2) as threads:
        for executor, parts in ((Local(1), range(4)), (Local(4), range(1)), (threads, range(4))):
            with team(executor, signed, parts, [1.0] * len(parts)) as ask:
                assert ask is None


@pytest.fixture(scope="module")
def many():
    """Demonstrations over 40 scenes of a few maps."""
    rng = np.random.default_rng(5)
    made = [one for number in range(40) for one in drawn(random_scene(rng, 9, 8, 0.1), REWARD, 2, number)]
    return evidence_of(made)


def everything(evidence):
    found, steps = likelihood(evidence, REWARD), step_likelihood(evidence, REWARD)
    return [
        found,
        steps,
        log_likelihood(evidence, REWARD),
        value_and_gradient(evidence, REWARD)[1].tolist(),
        feature_sums(evidence, REWARD).tolist(),
        path_covariance(evidence, REWARD)[0].tolist(),
    ]


@pytest.fixture
def kept_always(monkeypatch):
    monkeypatch.setattr(evidence_room, "ENOUGH_CELLS", 0)


@pytest.mark.usefixtures("kept_always")
def test_sums_over_scenes_are_the_same_whoever_works(many):
    here = everything(many)
    assert len(many.blocks) == 3
    for workers in (2, 3):
        with many.kept_by(Local(workers)) as kept:
            assert kept.ask is not None
            assert everything(kept) == here
            with pytest.raises(InfinitePartitionError, match="infinite partition function"):
                likelihood(kept, Reward((-1.0, -0.5, -4.0, 1.5)))


def test_sums_over_scenes_are_those_of_each_scene(many):
    alone = [likelihood(Evidence((part,), many.participants), REWARD) for part in many.scenes]
    found = likelihood(many, REWARD)
    for name in ("value", "gradient", "hessian", "scores", "information"):
        np.testing.assert_allclose(
            getattr(found, name), sum(getattr(one, name) for one in alone), rtol=1e-12, atol=1e-9
        )


@pytest.mark.usefixtures("kept_always")
def test_a_fit_is_the_same_whoever_works(many):
    with many.kept_by(Local(2)) as kept:
        assert fit(kept, REWARD, scan=False) == fit(many, REWARD, scan=False)


def test_what_travels_of_evidence_is_small_and_gives_the_same(many):
    likelihood(many, REWARD)
    written = pickle.dumps(many)
    again = pickle.loads(written)
    assert len(written) < 4000 * len(many.scenes)
    assert likelihood(again, REWARD) == likelihood(many, REWARD)
    part, other = many.scenes[0], again.scenes[0]
    assert other.scene.lattice.grid == part.scene.lattice.grid
    assert (other.scene.lattice.neighbours == part.scene.lattice.neighbours).all()


def test_few_cells_stay_in_this_process(many):
    with many.kept_by(Local(2)) as kept:
        assert kept is many
