"""Entry points of installed packages are read once, and again when a package comes or goes."""

import importlib.metadata
import itertools
import os

import pytest

from mbf_abstract.config import installed_plugins
from mbf_abstract.config.installed_plugins import DISTRIBUTION, entry_of, installed_points, is_ours, points_of

GROUP = "mbf.planners"


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put a distribution with a planner into a folder of the Python path."""
    monkeypatch.syspath_prepend(tmp_path)
    stamps = itertools.count(1)

    def install(name):
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{GROUP}]\n{name} = {name}:Planner\n")
        os.utime(tmp_path, (stamp := next(stamps), stamp))  # a fast machine may install two within a tick of its clock

    return install


def names():
    return {point.name for point in installed_points(GROUP)}


def test_a_package_that_was_installed_meanwhile_is_seen(install):
    install("spiral")
    before = names()
    install("zigzag")

    assert {"spiral"} <= before and "zigzag" not in before
    assert names() == before | {"zigzag"}
    assert points_of("planners")["zigzag"][0].value == "zigzag:Planner"


def test_what_has_not_changed_is_read_once(monkeypatch):
    reads = []
    monkeypatch.setattr(installed_plugins, "entry_points", lambda: reads.append(1) or importlib.metadata.entry_points())
    monkeypatch.setattr(installed_plugins, "_changes_of_path", tuple)  # other tests may write into a folder of the path
    installed_plugins._all_points.cache_clear()

    assert [bool(installed_points(group)) for group in (GROUP, "mbf.servers", "mbf.nothing")] == [True, True, False]
    assert len(reads) == 1


def test_the_metadata_of_a_package_are_read_once_for_all_of_its_plugins(monkeypatch):
    reads, metadata = [], importlib.metadata.Distribution.metadata.fget

    def counted(distribution):
        reads.append(distribution)
        return metadata(distribution)

    monkeypatch.setattr(importlib.metadata.Distribution, "metadata", property(counted))
    installed_plugins._all_points.cache_clear()
    installed_plugins._name_and_version.cache_clear()
    plugins = [points for points in points_of("planners").values() if is_ours(points)]

    assert len(plugins) > 5
    assert {entry_of("planners", points).origin.split()[0] for points in plugins} == {DISTRIBUTION}
    assert len(reads) == len(set(map(id, reads))), "no distribution is read twice"
