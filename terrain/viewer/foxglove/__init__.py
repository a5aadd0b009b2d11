"""A run or a robot live in Foxglove: a server of its WebSocket protocol, with the messages of run.mcap.

``service`` does what clients ask for, ``feeds`` takes what is new from a run or a robot, ``live`` puts both together.
Why the SDK's own server is not used: docs/decisions/0044-a-foxglove-server-of-our-own.md.
"""
