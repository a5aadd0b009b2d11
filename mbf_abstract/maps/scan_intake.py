"""Scans on their way into the maps, each placed by the transform at its own stamp.

A robot that turns at 1 rad/s turns by 6 degrees in the 0.1 s that a scan may be old when it arrives; placed by the
newest transform, all obstacles would be marked beside their places. So a scan is placed by the transform at its own
stamp, interpolated. A scan that is newer than the newest transform by at most ``transform_tolerance`` is placed by
that one, as some drivers deliver scans before the odometry of the same moment; nothing is extrapolated. A scan that is
newer still, or older than the history (``tf_cache_time``), is not used.

A map that cannot place a scan, or has a layer that raises, does not keep it from the other maps. Three faults are
reported once in the event log: a source that no layer listens to, a layer that raises, and a map that cannot place what
another one takes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.sensing import MAX_STAMP_LEAD, RangeScan
from mbf_abstract.maps.served_map import ServedMap

MAX_REPORTED = 100
"""Most reports that are remembered; a faulty driver may send any number of source names."""
MAX_SOURCES = 100
"""Most sources whose newest scan is kept, for the same reason."""


class ScanIntake:
    """Hands scans to maps.

    Parameters
    ----------
    runtime : Runtime
        Of the server.

    Attributes
    ----------
    newest : dict of str to RangeScan
        The newest scan of each source by its stamp, in the frame it came in, also of sources that no layer listens to;
        for plugins that look at scans themselves. A scan that all maps refuse is not kept, nor one without a finite
        ray. Arrays are copies, the ones that the layers have.
    """

    def __init__(self, runtime: Runtime, maps: Mapping[str, ServedMap[Any]]) -> None:
        self._runtime = runtime
        self._maps = maps
        self._reported: set[tuple[str, str]] = set()
        self.newest: dict[str, RangeScan] = {}

    def take(self, scan: RangeScan) -> None:
        """Insert a scan into every map that listens to its source and can place it; it is copied once.

        A scan of rays only whose ends are not finite is ignored.

        Raises
        ------
        TransformError
            None of the maps that listen can place it.
        ValueError
            Origin or stamp are not finite.
        """
        if not math.isfinite(scan.stamp):
            raise ValueError(f"the stamp of a scan must be finite, got {scan.stamp} from source {scan.source!r}")
        seen = scan.checked()
        listening = [name for name, served in self._maps.items() if served.map.listens_to(seen.source)]
        if not listening:
            self._report_unknown(seen.source)
        if len(scan.ends) and not len(seen.ends):
            return
        refused = {name: error for name in listening if (error := self._insert(name, seen)) is not None}
        if refused and len(refused) == len(listening):
            raise refused[listening[0]]
        for name in listening:
            self._report_refused(name, seen.source, refused.get(name))
        self._keep(seen)

    def _keep(self, scan: RangeScan) -> None:
        """Keep a scan unless a newer one has come; a stamp from the future does not keep those of now out."""
        kept = self.newest.get(scan.source)
        latest = self._runtime.clock.now() + MAX_STAMP_LEAD
        if kept is None and len(self.newest) >= MAX_SOURCES:
            return
        if kept is None or scan.stamp >= kept.stamp or kept.stamp > latest:
            self.newest[scan.source] = scan

    def _insert(self, name: str, scan: RangeScan) -> TransformError | None:
        served = self._maps[name]
        try:
            placed = scan.in_frame(served.map.frame_id, self._runtime.transforms, served.transform_tolerance)
        except TransformError as error:
            return error
        try:
            served.map.insert_scan(placed)
        except ValueError:  # of the scan itself: its driver is to blame
            raise
        except Exception as error:  # of a layer: the scan is good for the other maps
            text = f"a layer raised {type(error).__name__} at a scan of {scan.source!r}: {error_text(error)}"
            self._report(f"{name}.insert_scan", scan.source, text)
        return None

    def _report_unknown(self, source: str) -> None:
        known = sorted({name for served in self._maps.values() for name in served.map.source_names})
        if known:  # maps without any source are meant to see nothing
            self._report("take_scan", source, f"no layer listens to the source {source!r}; known: {known}")

    def _report_refused(self, name: str, source: str, error: TransformError | None) -> None:
        if error is None:
            self._reported.discard((name, source))
        else:
            self._report(name, source, f"the scans of {source!r} cannot be placed: {error}")

    def _report(self, where: str, source: str, message: str) -> None:
        if (where, source) not in self._reported and len(self._reported) < MAX_REPORTED:
            self._reported.add((where, source))
            self._runtime.events.emit(EventKind.FAULT, where, where="take_scan", message=message)
