"""Collects how a plugin or a map backend breaks its contract."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import IntEnum
from hashlib import blake2b
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.outcomes import is_success

R = TypeVar("R")


class ContractBroken(AssertionError):
    """A plugin or a map backend breaks its contract; the text lists how."""


class Report:
    """Violations of one plugin class or situation, and the arrays that must not change."""

    def __init__(
        self, subject: type | str, watched: Sequence[NDArray[Any]] = (), contract: str = "plugin contract"
    ) -> None:
        self._name = subject if isinstance(subject, str) else subject.__qualname__
        self._contract = contract
        self._watched = watched
        self._fingerprint = self._hash()
        self._violations: list[str] = []

    def expect(self, condition: bool, text: str) -> None:
        """Record ``text`` unless the condition holds; the same text only once."""
        if not condition and text not in self._violations:
            self._violations.append(text)

    @contextmanager
    def no_exception(self, situation: str) -> Iterator[None]:
        """Record an exception that leaves the body."""
        try:
            yield
        except Exception as error:
            self._record_exception(situation, error)

    def call(
        self, situation: str, function: Callable[[], Any], result_class: type[R], outcomes: type[IntEnum], span: range
    ) -> R | None:
        """Call the plugin's main method; record an exception and whatever is not legal about its result.

        Parameters
        ----------
        outcomes : type
            The action's outcomes.
        span : range
            The action's range of codes; its upper part, from 21 above its start on, is the plugin's own.

        Returns
        -------
        object or None
            The result, or None if it cannot be checked further.
        """
        try:
            result = function()
        except Exception as error:
            self._record_exception(situation, error)
            return None
        if not isinstance(result, result_class):
            self.expect(False, f"{situation}: returned {type(result).__name__}, not {result_class.__name__}")
            return None
        outcome, message = getattr(result, "outcome", None), getattr(result, "message", None)
        known = isinstance(outcome, int) and (
            is_success(outcome) or outcome in outcomes._value2member_map_ or outcome in span[21:]
        )
        self.expect(known, f"{situation}: outcome {outcome} is not one of {outcomes.__name__}")
        self.expect(isinstance(message, str), f"{situation}: the message is {type(message).__name__}, not a text")
        failed = isinstance(outcome, int) and not is_success(outcome)
        self.expect(bool(message) or not failed, f"{situation}: failed with {outcome} but without a message")
        return result if known else None

    def finish(self) -> None:
        """Raise ContractBroken if anything was recorded or a watched array has changed."""
        self.expect(self._hash() == self._fingerprint, "it changed an array it was only shown")
        if self._violations:
            raise ContractBroken(f"{self._name} breaks the {self._contract}:\n- " + "\n- ".join(self._violations))

    def _record_exception(self, situation: str, error: Exception) -> None:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        self.expect(False, f"{situation}: raised {type(error).__name__}: {error} ({frame.name}:{frame.lineno})")

    def _hash(self) -> bytes:
        digest = blake2b()
        for array in self._watched:
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.digest()
