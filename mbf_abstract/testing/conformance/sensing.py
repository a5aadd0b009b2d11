"""How every backend takes scans: good ones, broken ones, those of unknown sources."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_abstract.events import EventKind
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.queries import CellState
from mbf_abstract.testing.conformance.planning import FACE, WALL
from mbf_abstract.testing.conformance.rig import SENSOR
from mbf_abstract.testing.conformance.site import Site, situation


@situation()
def what_the_sensor_sees_is_lethal_until_it_is_gone(site: Site) -> None:
    """What was hit is lethal at its place, and free again when rays have gone through it for a while."""
    site.place(WALL)
    site.expect_state(FACE, CellState.LETHAL)
    site.place()
    site.rig.clock.sleep(2.0)  # for maps that want evidence
    site.server.queries.update_map()
    site.expect_free(FACE)


@situation()
def a_scan_is_placed_by_the_transform_of_its_stamp(site: Site) -> None:
    """A scan in the sensor's frame is placed where the robot was when it was taken."""
    site.rig.boxes = [WALL]
    seen = site.rig.scan()
    site.rig.boxes = []
    site.navigator.exe_path(site.path((2.0, 4.0), (3.0, 5.0)))
    site.rig.sensing = False
    site.sees(seen)
    site.expect_state(FACE, CellState.LETHAL)


@situation()
def an_unknown_source_is_reported_once(site: Site) -> None:
    """Scans of an unknown source change nothing, and are reported once with the sources that are known."""
    site.rig.sensing = False
    for _ in range(3):
        site.sees(site.ray(2.0, 4.0, hit=True, source="stranger"))
    site.expect_free(FACE)
    reported = [
        event for event in site.rig.memory.of_kind(EventKind.FAULT) if "stranger" in str(event.data.get("message"))
    ]
    site.expect(len(reported) == 1, f"expected one report of the unknown source, got {len(reported)}")
    if reported:
        text = str(reported[0].data["message"])
        site.expect(SENSOR in text, f"the report does not name the known source {SENSOR!r}: {text}")


@situation()
def a_scan_of_nothing_but_nan_is_ignored(site: Site) -> None:
    """A scan without any finite ray neither marks nor clears, and is no sign of life of its sensor."""
    site.place(WALL)
    site.rig.sensing = False
    for _ in range(8):
        scan = site.rig.scan()
        site.sees(replace(scan, ends=np.full_like(scan.ends, np.nan)))
        site.rig.clock.sleep(0.2)
    site.expect_state(FACE, CellState.LETHAL)
    site.expect(bool(site.server.map_problem()), "1.6 s of scans without a finite ray count as a sensor that works")


@situation()
def the_finite_rays_of_a_scan_count(site: Site) -> None:
    """Of a scan with some rays that are not finite, the others are used."""
    site.rig.sensing = False
    scan = site.ray(2.0, 4.0, hit=True)
    broken = replace(scan, ends=np.vstack([scan.ends, [np.nan, np.inf, 0.0]]), hits=np.array([True, True]))
    site.sees(broken)
    site.expect_state(FACE, CellState.LETHAL)


@situation()
def a_scan_from_nowhere_or_never_is_refused(site: Site) -> None:
    """A scan whose origin or stamp is not finite is a ValueError, one in an unknown frame a TransformError."""
    scan = site.ray(2.0, 4.0, hit=True)
    take = site.server.take_scan
    lost = replace(scan, origin=np.array([np.nan, 0.0, 0.0]))
    site.expect_raises(ValueError, lambda: take(lost), "an origin of NaN")
    site.expect_raises(ValueError, lambda: take(replace(scan, stamp=float("inf"))), "a stamp of inf")
    site.expect_raises(TransformError, lambda: take(replace(scan, frame_id="nowhere")), "an unknown frame")
    site.server.queries.update_map()
    site.expect_free(FACE)


@situation()
def a_scan_before_all_transforms_is_refused(site: Site) -> None:
    """A scan that is older than the history of transforms is a TransformError."""
    scan = replace(site.rig.scan(), stamp=-100.0)
    site.expect_raises(TransformError, lambda: site.server.take_scan(scan), "a stamp of long ago")
