"""How a command that runs ends, and what it shows of the robot it waits for."""

import os
import signal

import pytest
import typer

from mbf_ros.ending import Parent, shown_state, wait_for_ctrl_c


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows does not say when a parent is gone")
@pytest.mark.parametrize("ignored", [False, True])
def test_a_command_ends_with_its_parent_unless_it_is_to_outlive_it(monkeypatch, capsys, ignored):
    parent, looks, another = Parent(), [], os.getppid() + 1  # 1 would be the same one in a container
    parent.end_without()
    monkeypatch.setattr(os, "getppid", lambda: another)
    monkeypatch.setattr(signal, "getsignal", lambda number: signal.SIG_IGN if ignored else signal.SIG_DFL)

    def look():
        looks.append(None)
        if len(looks) == 3:
            signal.raise_signal(signal.SIGINT)

    if ignored:
        wait_for_ctrl_c(parent, look, 0.0)
        assert len(looks) == 3
        return
    with pytest.raises(typer.Exit):
        wait_for_ctrl_c(parent, look, 0.0)
    assert len(looks) == 1 and "nohup" in capsys.readouterr().err


def test_another_topic_or_frame_is_shown_and_the_same_one_only_once():
    problems = [
        "no message has come on /odom yet",
        "no message on /odom for 0.53 s",
        "no message on /odom for 0.63 s",
        "no transform from 'base_2' to 'map': it is unknown",
        "no transform from 'base_3' to 'map': it is unknown",
        "compiling kernels",
        "",
        "",
        "no message on /odom for 0.55 s",
    ]
    shown, left = [], iter(problems)
    look = shown_state(lambda: next(left), shown.append)
    for _ in problems:
        look()
    assert shown == [
        "waiting: no message has come on /odom yet",
        "waiting: no message on /odom for 0.53 s",
        "waiting: no transform from 'base_2' to 'map': it is unknown",
        "waiting: no transform from 'base_3' to 'map': it is unknown",
        "waiting: compiling kernels",
        "move_base_flex is ready",
        "waiting: no message on /odom for 0.55 s",
    ]
