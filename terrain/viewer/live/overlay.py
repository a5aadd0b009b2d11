"""One kind of thing in the scene that can be switched off in the page and is drawn again only when it has changed."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any


class Overlay:
    """A check box and the scene node it belongs to.

    Parameters
    ----------
    label : str
        Label of the box.
    """

    def __init__(self, gui: Any, label: str) -> None:
        self._box = gui.add_checkbox(label, True)
        self._key: Hashable = None
        self._handle: Any = None

    def update(self, key: Hashable, draw: Callable[[], Any]) -> None:
        """Draw with ``draw`` if ``key`` is not that of the last drawing.

        ``draw`` returns the handle of the node it has put into the scene, always of the same name, or None.
        """
        if not self._box.value:
            self.clear()
        elif key != self._key:
            self._key = key
            before, self._handle = self._handle, draw()
            if before is not None and self._handle is None:
                before.remove()

    def clear(self) -> None:
        """Remove what was drawn."""
        self._key = None
        if self._handle is not None:
            self._handle.remove()
            self._handle = None
