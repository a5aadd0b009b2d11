"""The sensors of a scenario on a running session: what the server gets, and what faults do to it."""

import pytest

from mbf_abstract.geometry import Twist
from terrain.scenarios.faults import LocalizationJump, SensorFault
from terrain.scenarios.noise import LocalizationNoise
from terrain.scenarios.scenario import PlanarPose, Sensor, load_scenario
from terrain.scenarios.world_types import GeneratedWorld
from terrain.session.session import Session, SessionOptions

CAMERA = Sensor(name="camera", type="depth", rays=16, rate=5.0)


@pytest.fixture
def sensing():
    """Level ground, wheel odometry, an IMU and a small depth camera; ``faults`` may befall them."""

    def make(*faults):
        return load_scenario("outdoor").model_copy(
            update={
                "world": GeneratedWorld(type="generated", size=(12.0, 10.0), spacing=0.5),
                "start": PlanarPose(x=3.0, y=5.0, yaw=0.5),
                "goals": (PlanarPose(x=9.0, y=5.0),),
                "sensors": (CAMERA,),
                "odometry": "wheels",
                "localization": LocalizationNoise(),
                "imu": True,
                "faults": faults,
            }
        )

    return make


def drive(session, seconds):
    """Push the robot straight ahead without a controller."""
    end = session.clock.now() + seconds
    while session.clock.now() < end:
        session.robot.send_command(Twist.planar(0.5))
        session.clock.sleep(0.1)


def place(session, target, source):
    return session.navigator.server.runtime.transforms.lookup(target, source)


def test_wheel_odometry_drifts_in_odom_and_the_localisation_corrects_it(sensing):
    with Session(sensing(), SessionOptions(backend="mesh", seed=4)) as session:
        drive(session, 4.0)
        estimated, truth = place(session, "map", "base_link"), session.robot.pose()
        travelled = place(session, "odom", "base_link")
        reported, true = session.navigator.server.runtime.robot.velocity(), session.robot.velocity()
    assert estimated.translation == pytest.approx(truth.position, abs=0.03)  # one period of odometry old
    assert travelled.translation[0] == pytest.approx(truth.distance_to(session.recorder.start), rel=0.1)
    assert travelled.translation[1] == pytest.approx(0.0, abs=0.2)  # odom lies along the robot's first heading
    assert reported.vx != true.vx
    assert reported.vx == pytest.approx(true.vx, rel=0.2)


def test_a_jump_of_the_localisation_moves_odom_in_the_map_and_not_the_robot_in_odom(sensing):
    jump = LocalizationJump(type="jump", start=1.0, dx=0.4)
    with Session(sensing(jump), SessionOptions(backend="mesh")) as session:
        before = place(session, "map", "odom"), place(session, "odom", "base_link")
        session.clock.sleep(1.0)
        after = place(session, "map", "odom"), place(session, "odom", "base_link")
    assert after[0].translation[0] - before[0].translation[0] == pytest.approx(0.4, abs=0.02)
    assert after[1].translation == pytest.approx(before[1].translation, abs=0.02)


@pytest.mark.parametrize("name", ["odometry", "imu", "camera"])
def test_every_sensor_can_be_made_silent_stale_and_wrong_by_the_scenario(sensing, name):
    faults = [
        SensorFault(type=kind, sensor=name, start=start, end=start + 1.0)
        for start, kind in ((1.0, "silent"), (2.0, "stale"), (3.0, "wrong"))
    ]
    seen = []
    with Session(sensing(*faults), SessionOptions(backend="mesh")) as session:
        session.simulation.on_measurement(lambda topic, m: seen.append(m) if topic == name else None)
        drive(session, 4.2)
    stamps = [getattr(m, "stamp", None) or m.pose.stamp for m in seen]
    assert not [stamp for stamp in stamps if 1.05 < stamp < 1.95]  # silent
    assert len(stamps) - len(set(stamps)) >= 4  # stale: the last one comes again and again
    honest, wrong = ([m for m, s in zip(seen, stamps, strict=True) if lo < s < hi][-1] for lo, hi in ((0, 1), (3.2, 4)))
    if name == "odometry":
        assert honest.odometry.velocity.vx > 0.0 > wrong.odometry.velocity.vx
    elif name == "imu":
        assert abs(honest.roll) < 0.05 and wrong.roll > 0.3
    else:
        assert honest.hits.any() and wrong.hits.all()


def test_a_robot_whose_odometry_falls_silent_loses_its_pose_and_that_is_reported(sensing):
    silent = SensorFault(type="silent", sensor="odometry", start=1.0)
    with Session(sensing(silent), SessionOptions(backend="mesh")) as session:
        result = session.navigator.go_to(session.goals[0])
        assert not result.success
        assert session.robot.velocity().speed < 0.02
        assert session.robot.pose().distance_to(session.goals[0]) > 3.0
