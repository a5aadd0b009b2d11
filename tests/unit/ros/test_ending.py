"""What a command that runs shows of the robot it waits for."""

from mbf_ros.ending import shown_state


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
