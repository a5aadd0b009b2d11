"""Coroutines that await values of another thread, on an executor to which nothing else comes."""

import sys
import threading
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future

from mbf_ros.ros2.running import settle

ROUNDS = 20

rclpy.init()
executor = SingleThreadedExecutor()


def settle_later(future):
    time.sleep(0.01)  # the executor waits by now
    settle(future, executor, 1)


async def add_up():
    total = 0
    for _ in range(ROUNDS):
        future = Future(executor=executor)
        threading.Thread(target=settle_later, args=(future,)).start()
        total += await future
    return total


task = executor.create_task(add_up)
while not task.done():
    executor.spin_once()
sys.stdout.write(f"{task.result()}\n")
