"""The report of a built map: its figures, a picture of each step, a test plan between the farthest places."""

import base64
import io
import re

import networkx
import numpy as np
import pytest
from cloud_files import write_text
from PIL import Image
from surveyed_ground import bridge, flat, ground, post
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_mesh_nav.building.clouds.point_cloud import read_clouds
from mbf_mesh_nav.building.farthest_plan import farthest_vertices, plan_farthest
from mbf_mesh_nav.building.map_build import build_map
from mbf_mesh_nav.building.map_facts import map_facts
from mbf_mesh_nav.building.pictures import (
    BLUE,
    GREY,
    LOW,
    ORANGE,
    RED,
    change_picture,
    error_picture,
    height_picture,
    level_picture,
)
from mbf_mesh_nav.building.surface import SurfaceParameters, build_surface
from mbf_mesh_nav.map.mesh_map import MeshMap


def pixel(png, x, y, size=(16.0, 12.0)):
    """Colour at a place [m] of a picture of the ground of ``size``."""
    image = Image.open(io.BytesIO(png))
    return image.getpixel((int(x / size[0] * image.width), int((1.0 - y / size[1]) * image.height)))


@pytest.fixture(scope="module")
def scene():
    """Level ground with a hole, a post and a table of one square metre."""
    rng = np.random.default_rng(8)
    points = ground(rng, flat)
    points = points[np.hypot(points[:, 0] - 4.0, points[:, 1] - 3.0) > 0.4]
    table = np.column_stack([rng.uniform((10.0, 8.0), (12.0, 10.0), (500, 2)), np.full(500, 1.8)])
    return build_surface(np.vstack([points, post(rng, 8.125, 6.125, 0.0), table]))


def test_the_report_has_the_figures_the_pictures_and_a_plan(tmp_path):
    points = write_text(tmp_path / "a <bridge>.xyz", bridge(np.random.default_rng(2)))
    report = tmp_path / "report.html"
    arguments = ["map", "build", points, "--out", tmp_path / "map.ply", "--report", report]
    done = CliRunner().invoke(make_app(), [str(argument) for argument in arguments])
    assert done.exit_code == 0, done.output
    page = report.read_text("utf-8")
    assert "From a &lt;bridge&gt;.xyz" in page
    assert "SUCCESS" in page
    assert "note: test plan by dijkstra: SUCCESS" in done.stderr
    assert all(f"<td>{line.split()[0]}" in page for line in done.stdout.splitlines())
    pictures = [base64.b64decode(text) for text in re.findall(r"base64,([^\"]+)", page)]
    assert len(pictures) == 5
    assert {Image.open(io.BytesIO(png)).size for png in pictures} == {Image.open(io.BytesIO(pictures[0])).size}
    assert "http" not in page.replace("http://www.w3.org", "")


def test_the_pictures_show_what_was_filled_and_left_out(scene):
    png, _ = change_picture(scene)
    assert pixel(png, 14.0, 2.0) == GREY
    assert pixel(png, 4.0, 3.0) == BLUE
    assert pixel(png, 8.125, 6.125) == RED
    assert pixel(png, 11.0, 9.0) == ORANGE


def test_levels_and_heights_are_coloured_by_their_numbers():
    surface = build_surface(bridge(np.random.default_rng(2)))
    png, caption = level_picture(surface)
    assert pixel(png, 6.0, 6.0, (32.0, 12.0)) == GREY
    assert pixel(png, 16.0, 6.0, (32.0, 12.0)) not in (GREY, (255, 255, 255))
    assert caption.endswith("red 2.")
    png, caption = height_picture(surface, np.array([[14.0, 1.125, 0.0], [18.0, 1.125, 0.0]]))
    assert pixel(png, 16.0, 1.125, (32.0, 12.0)) == (20, 20, 20)
    assert np.abs(np.subtract(pixel(png, 16.0, 10.5, (32.0, 12.0)), LOW)).max() < 20
    assert re.search(r"blue -0.\d m, red 3.\d m", caption)


def test_the_picture_of_the_error_shows_each_cells_mean_distance(scene):
    png, caption = error_picture(scene)
    assert re.search(r"blue 0.0[01]\d m below", caption)
    assert pixel(png, 4.0, 3.0) == (255, 255, 255)  # a filled hole has no point


def test_the_figures_are_those_of_the_surface(scene, tmp_path):
    cloud = read_clouds([write_text(tmp_path / "scene.xyz", scene.points)])
    facts = map_facts(cloud, build_surface(cloud.points))
    by_chance = 16.0 * 12.0 * np.exp(-4.0)  # cells without a point, of four on average
    assert facts.filled_area == pytest.approx(0.5 + by_chance, abs=0.4)
    assert facts.obstacle_area == pytest.approx(0.04)
    assert facts.small_area == pytest.approx(4.0, abs=0.2)
    assert facts.area == pytest.approx(16.0 * 12.0, abs=0.5)
    assert facts.density == pytest.approx(100.0)
    distances = scene.distances[np.isfinite(scene.distances)]
    assert facts.error_rms == pytest.approx(float(np.sqrt((distances.astype(float) ** 2).mean())), abs=1e-6)
    assert facts.error_rms <= facts.error_95 <= facts.error_max
    # Four points a cell, three of them free; the mean of 1/n is 0.33, of the usual number 0.25.
    assert facts.height_error == pytest.approx(facts.error_rms / 2.0 * np.sqrt(4.0 / 3.0 * 0.33 / 0.25), rel=0.05)


def test_the_test_plan_is_between_vertices_that_are_nearly_the_farthest():
    # An L of free ground: its ends are the farthest places along the surface, its corners are not.
    rng = np.random.default_rng(3)
    points = ground(rng, flat)
    points = points[(points[:, 0] < 3.0) | (points[:, 1] < 3.0)]
    surface = build_surface(points, SurfaceParameters(cell=0.5, hole_width=0.0))
    mesh_map = MeshMap.from_arrays(surface.vertices, surface.faces)
    free = np.ones(len(mesh_map.vertices), dtype=np.bool_)
    first, second = farthest_vertices(mesh_map, free)
    graph = networkx.Graph()
    for a, b in mesh_map.topology.edges.tolist():
        graph.add_edge(a, b, weight=float(np.linalg.norm(mesh_map.vertices[a] - mesh_map.vertices[b])))
    lengths = dict(networkx.all_pairs_dijkstra_path_length(graph))
    longest = max(max(row.values()) for row in lengths.values())
    assert 0.9 * longest < lengths[first][second] <= longest + 1e-9


def test_the_test_plan_is_that_of_mbf_plan_and_does_not_zigzag(tmp_path):
    out = tmp_path / "flat.ply"
    build_map([write_text(tmp_path / "flat.xyz", ground(np.random.default_rng(3), flat))], out)
    plan = plan_farthest(out)
    straight = np.linalg.norm(np.subtract(plan.goal, plan.start))
    assert plan.success and "refined by string_pulling" in plan.text
    assert np.linalg.norm(np.diff(plan.path, axis=0), axis=1).sum() < 1.03 * straight  # along the edges it is 1.05
    start, goal = ([f"{number:.6f}" for number in place] for place in (plan.start, plan.goal))
    done = CliRunner().invoke(make_app(), ["plan", str(out), "--start", *start, "--goal", *goal])
    assert "refined by string_pulling, the cost is that before" in done.stdout


def test_where_nothing_is_free_the_report_says_so(tmp_path):
    rng = np.random.default_rng(3)
    points = ground(rng, lambda x, y: 2.0 * x, size=(8.0, 8.0))  # 63 degrees
    out = tmp_path / "steep.ply"
    build_map([write_text(tmp_path / "steep.xyz", points)], out)
    plan = plan_farthest(out)
    assert not plan.success
    assert plan.text == "no vertex is free, so nothing can be planned"
    assert farthest_vertices(MeshMap.from_arrays(np.eye(3), [[0, 1, 2]]), np.zeros(3, dtype=np.bool_)) is None
