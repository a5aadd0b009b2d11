"""The page on Foxglove and its layout name topics, fields, services and parameters that there are."""

import json
import re
from pathlib import Path

from terrain.viewer.foxglove.steering import INPUTS, SERVICES
from terrain.viewer.logs.run_messages import JSON_FIELDS, TOPICS

DOCS = Path(__file__).resolve().parents[2] / "docs"
LAYOUT = json.loads((DOCS / "foxglove_layout.json").read_text("utf-8"))
PANELS = LAYOUT["configById"]


def leaves(node):
    """Panels of a layout, those in tabs too."""
    if isinstance(node, str):
        inside = PANELS[node].get("tabs", ()) if node.startswith("Tab!") else ()
        return [node, *(leaf for tab in inside for leaf in leaves(tab["layout"]))]
    return [*leaves(node["first"]), *leaves(node["second"])]


def panels(kind):
    return [settings for name, settings in PANELS.items() if name.startswith(f"{kind}!")]


def test_every_panel_of_the_layout_is_configured_and_shown_once():
    assert sorted(leaves(LAYOUT["layout"])) == sorted(PANELS)


def test_the_layout_draws_topics_that_are_served_and_publishes_goals_where_they_are_taken():
    (view,) = panels("3D")
    assert set(view["topics"]) <= set(TOPICS)
    assert {view["publish"][f"{kind}Topic"] for kind in ("pose", "point", "poseEstimate")} == set(INPUTS)
    assert [one["topicToRender"] for one in panels("RosOut")] == ["/log"]
    assert {one["topicPath"] for one in panels("RawMessages")} <= set(TOPICS)


def test_plots_and_states_are_of_fields_that_their_messages_have():
    paths = [path["value"] for kind in ("Plot", "StateTransitions") for one in panels(kind) for path in one["paths"]]
    for topic, field in (path.split(".") for path in paths):
        assert field in JSON_FIELDS[TOPICS[topic]], (topic, field)
    assert paths


def test_the_buttons_call_the_services():
    assert {one["serviceName"] for one in panels("CallService")} == set(SERVICES)


def test_the_page_names_all_topics_inputs_and_services_and_no_others():
    rows = set(re.findall(r"^\| `(/\w+(?:/\w+)?)`", (DOCS / "foxglove.md").read_text("utf-8"), re.MULTILINE))
    assert rows == {*TOPICS, *INPUTS, *SERVICES}
