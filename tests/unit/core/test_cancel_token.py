"""The cancel token: set once, and no callback is lost in the moment it is set."""

import sys
import threading

import pytest

from mbf_abstract.time.cancel import CancelToken


def test_a_callback_runs_once_whether_it_comes_before_or_after_the_cancel():
    token, log = CancelToken(), []
    token.on_cancel(lambda: log.append("before"))
    assert token.cancel("enough")
    assert not token.cancel("again")
    token.on_cancel(lambda: log.append("after"))
    assert (log, token.reason, token.cancelled) == (["before", "after"], "enough", True)


def test_a_callback_may_ask_the_token_and_add_another():
    token, log = CancelToken(), []
    token.on_cancel(lambda: token.on_cancel(lambda: log.append(token.cancelled)))
    token.cancel()
    assert log == [True]


@pytest.fixture
def hasty_threads():
    """Let threads take turns as often as Python can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_of_callbacks_added_while_it_is_set_by_two_threads_none_is_lost_or_doubled(hasty_threads):
    for _ in range(300):
        token, log, wins = CancelToken(), [], []
        barrier = threading.Barrier(3)

        def add(token=token, log=log, barrier=barrier):
            barrier.wait()
            for number in range(20):
                token.on_cancel(lambda number=number: log.append(number))

        def cancel(token=token, wins=wins, barrier=barrier):
            barrier.wait()
            wins.append(token.cancel())

        threads = [threading.Thread(target=body) for body in (add, cancel, cancel)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sorted(wins) == [False, True]
        assert sorted(log) == list(range(20))
