"""Worlds: heightfields, buildings, PyBullet physics, robots and sensors, to show the navigation servers at work.

``import terrain`` needs neither PyBullet nor matplotlib; modules import them where they are used and name the extra to
install.
"""
