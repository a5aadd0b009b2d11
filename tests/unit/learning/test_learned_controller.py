"""The example: its policy is symmetric, its training is resumable, and its weights drive."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "learned_controller"
MODULES = ("policy", "train")


@pytest.fixture(scope="module")
def example():
    """The modules of the example, imported as in its folder."""
    pytest.importorskip("gymnasium", reason="needs the extra gym")
    sys.path.insert(0, str(FOLDER))
    try:
        import policy
        import train

        yield policy, train
    finally:
        sys.path.remove(str(FOLDER))
        for name in MODULES:
            sys.modules.pop(name, None)


values = st.floats(-2.0, 2.0)
scans = st.lists(st.floats(0.0, 2.0), min_size=24, max_size=24)
plans = st.lists(st.tuples(values, values), min_size=4, max_size=4)


@given(scan=scans, plan=plans, speed=values, turning=values, seed=st.integers(0, 99))
def test_a_mirrored_world_gives_the_mirrored_command(example, scan, plan, speed, turning, seed):
    policy, _ = example
    weights = np.random.default_rng(seed).normal(size=policy.SIZE)
    mirrored_plan = np.array(plan) * [1.0, -1.0]
    ahead, turn = policy.action(
        weights, {"scan": np.array(scan), "waypoints": np.array(plan), "velocity": np.array([speed, 0.0, turning])}
    )
    mirrored = {"scan": np.array(scan[::-1]), "waypoints": mirrored_plan, "velocity": np.array([speed, 0.0, -turning])}
    assert policy.action(weights, mirrored) == pytest.approx([ahead, -turn], abs=1e-9)


def test_a_training_that_was_stopped_ends_with_the_same_numbers(example, tmp_path, monkeypatch):
    policy, train = example
    monkeypatch.setattr(train, "STATE", tmp_path / "training.json")
    for module in (policy, train):
        monkeypatch.setattr(module, "WEIGHTS", tmp_path / "weights.json")

    def drive_all(jobs):
        return [float(-np.square(weights - 0.3).sum() - room % 7) for weights, room in jobs]

    _, mean, spread = train.read_state()
    for number in range(4):
        mean, spread = train.generation(number, mean, spread, drive_all)[:2]
    for _ in range(4):
        done, stopped, width = train.read_state()
        train.write_state(done + 1, *train.generation(done, stopped, width, drive_all)[:2])
    done, stopped, _ = train.read_state()
    assert done == 4 and stopped.tolist() == mean.tolist()
    assert np.square(mean - 0.3).sum() < np.square(train.start() - 0.3).sum()
    assert policy.read_weights() == mean.tolist()


def test_the_shipped_weights_drive_through_a_room_that_they_were_not_trained_in(example, drive):
    policy, train = example
    weights = policy.read_weights()
    assert len(weights) == policy.SIZE
    environment = train.of_bench_indoor([0], observation=policy.OBSERVED, commands=policy.COMMANDS)
    try:
        _, steps = drive(environment, lambda seen: policy.action(weights, seen), seed=0)
        assert steps[-1][4]["success"], steps[-1][4]["verdict"]
    finally:
        environment.close()


@pytest.mark.parametrize("text", ["", "{}", "[1, 2]"])
def test_a_state_of_a_training_that_is_none_is_named(example, text, tmp_path, monkeypatch, capsys):
    _, train = example
    monkeypatch.setattr(train, "STATE", tmp_path / "training.json")
    monkeypatch.setattr(sys, "argv", ["train.py"])
    (tmp_path / "training.json").write_text(text)
    with pytest.raises(SystemExit) as ended:
        train.main()
    assert ended.value.code == 2
    assert "training.json: expected the state of a training" in capsys.readouterr().err


def test_a_training_that_is_stopped_by_ctrl_c_says_how_it_goes_on(example, monkeypatch, capsys):
    _, train = example
    monkeypatch.setattr(sys, "argv", ["train.py"])

    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(train, "train", stopped)
    with pytest.raises(SystemExit) as ended:
        train.main()
    assert ended.value.code == 130
    assert capsys.readouterr().err == "stopped; the next call goes on after the last generation\n"


@pytest.mark.parametrize("words", [("--workers", "0"), ("--workers", "two"), ("--generations", "-1")])
def test_a_training_without_workers_or_generations_is_refused(example, words, monkeypatch, capsys):
    _, train = example
    monkeypatch.setattr(sys, "argv", ["train.py", *words])
    with pytest.raises(SystemExit) as ended:
        train.main()
    assert ended.value.code == 2
    assert f"{words[0]}: expected a whole number of at least 1, got '{words[1]}'" in capsys.readouterr().err
