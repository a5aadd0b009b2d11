"""Worlds: heightfields, buildings, PyBullet physics, robots and sensors, to show the navigation servers at work.

``import terrain`` needs neither PyBullet nor matplotlib; the modules that use them say so and import them
when they are asked to.
"""
