"""The option ``--seeds`` of the benchmarks."""

from __future__ import annotations

import argparse

import typer

from terrain.sweeps.command import parse_seeds


def seed_list(text: str) -> list[int]:
    """The numbers of ``0:20`` or ``1,5,9``, as the type of an argument: where they are wrong, one line says so."""
    try:
        return parse_seeds(text)
    except typer.BadParameter as error:
        raise argparse.ArgumentTypeError(error.message) from error
