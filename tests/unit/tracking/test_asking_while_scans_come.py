"""Tracked objects are asked for on other threads while a scan is taken in: by the guard before contact, by viewers."""

import threading

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.kernels import filtering
from mbf_abstract.maps.tracking.moving_obstacles import MovingObstacles, MovingObstaclesParameters
from mbf_abstract.maps.tracking.robot_box import RobotBox

PARAMETERS = MovingObstaclesParameters(sources=("lidar",))
GIVEN = 0.5
"""How long [s] a reader may take that does not wait; one that waits for the scan takes as long."""


def seen_at(x, stamp):
    points = np.column_stack([np.full(9, x), np.linspace(-0.2, 0.2, 9), np.zeros(9)])
    return RangeScan.of_points("lidar", points, (0.0, 0.0, 0.3), stamp, "map")


def take_in(tracked, *scans):
    for one in scans:
        tracked.insert_scan(one)
    return list(tracked.take_in(PARAMETERS, lambda scan: (scan.ends, np.arange(len(scan.ends)))))


def walker():
    """Somebody who comes along x at 1 m/s, seen until 1 s."""
    tracked = MovingObstacles(PARAMETERS, "map")
    take_in(tracked, *(seen_at(3.0 + 0.1 * step, 0.1 * step) for step in range(11)))
    return tracked


def test_nobody_sees_objects_of_a_scan_that_is_half_taken_in(monkeypatch):
    tracked, answers, predict = walker(), [], filtering.predict
    reader = threading.Thread(target=lambda: answers.append(tracked.objects(1.1)))

    def predict_and_be_asked(*arguments):
        predict(*arguments)
        reader.start()
        reader.join(GIVEN)

    monkeypatch.setattr(filtering, "predict", predict_and_be_asked)
    take_in(tracked, seen_at(4.1, 1.1))
    reader.join()
    assert answers == [tracked.objects(1.1)] and len(answers[0]) == 1


def test_nobody_sees_objects_that_are_half_forgotten():
    tracked, answers = walker(), []
    reader = threading.Thread(target=lambda: answers.append(tracked.objects(1.1)))

    def everywhere(places):
        reader.start()
        reader.join(GIVEN)
        return np.ones(len(places), dtype=np.bool_)

    tracked.clear(everywhere)
    reader.join()
    assert answers == [()]


def test_controllers_of_two_slots_ask_for_whom_the_robot_stands_one_after_the_other():
    tracked, waits = walker(), []
    question = PARAMETERS, RobotBox.disc(0.3), Pose.planar(0.0, 0.0), tracked.objects(1.0), 1.0
    reader = threading.Thread(target=lambda: tracked.lost_contact(*question))

    class Asked(RobotBox):
        def gaps(self, *arguments):
            reader.start()
            reader.join(GIVEN)
            waits.append(reader.is_alive())
            return super().gaps(*arguments)

    assert tracked.lost_contact(PARAMETERS, Asked.disc(0.3), *question[2:]) is None
    reader.join()
    assert waits == [True]
