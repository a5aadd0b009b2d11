"""A running tree in the event log: written once and then by its changes, and read again without the tree."""

from py_trees.common import Status
from py_trees.composites import Sequence

from mbf_abstract.events import Event, EventKind
from mbf_abstract.executives.tree_events import SYMBOLS, TreeState
from mbf_abstract.executives.tree_executive import TreeExecutive


def run(make_session, tree, cancel_at=0):
    """Run a tree; returns its events, through their text form as in a file."""
    session = make_session()
    executive = TreeExecutive(tree, session.navigator, period=0.1)
    if cancel_at:
        executive.on_tick.append(lambda tick: executive.cancel("enough") if tick == cancel_at else None)
    executive.run()
    return [Event.from_json(event.to_json()) for event in session.recorded(EventKind.TREE)]


def read(events):
    state = TreeState()
    for event in events:
        assert state.take(event)
    return state


def statuses(state):
    return {node.name: node.status for node in state.nodes}


def test_the_log_reports_the_tree_once_and_then_only_ticks_that_change_something(make_session, scripted):
    tree = Sequence("both", True, [scripted("RRRRS", "wait"), scripted("RRS", "then")])

    begin, *changes = run(make_session, tree)

    assert [(node["name"], node["depth"]) for node in begin.data["nodes"]] == [("both", 0), ("wait", 1), ("then", 1)]
    assert [event.data["tick"] for event in changes] == [1, 5, 7]
    assert changes[1].data["changes"] == [[1, "SUCCESS", ""], [2, "RUNNING", ""]]


def test_a_reader_sees_every_status_the_tree_had(make_session, scripted):
    tree = Sequence("both", True, [scripted("RS", "first"), scripted("RRF", "second")])
    seen = []
    session = make_session()
    executive = TreeExecutive(tree, session.navigator)
    executive.on_tick.append(lambda tick: seen.append([node.status.value for node in (tree, *tree.children)]))
    executive.run()

    state, read_again = TreeState(), []
    for event in session.recorded(EventKind.TREE):
        state.take(event)
        read_again.append([node.status for node in state.nodes])

    changed = [now for now, before in zip(seen, [None, *seen], strict=False) if now != before]
    assert read_again[1:] == changed


def test_the_log_keeps_how_a_tree_ended(make_session, scripted):
    state = read(run(make_session, Sequence("both", True, [scripted("S", "good"), scripted("RF", "bad")])))

    assert statuses(state) == {"both": "FAILURE", "good": "SUCCESS", "bad": "FAILURE"}


def test_a_tree_that_is_broken_off_is_idle_again(make_session, scripted):
    state = read(run(make_session, Sequence("one", True, [scripted("R", "for ever")]), cancel_at=3))

    assert statuses(state) == {"one": "INVALID", "for ever": "INVALID"}
    assert state.tick == 3


def test_a_second_run_begins_with_an_idle_tree(make_session, scripted):
    session = make_session()
    executive = TreeExecutive(scripted("S", "again"), session.navigator)
    executive.run()
    executive.run()

    events = session.recorded(EventKind.TREE)
    assert ["nodes" in event.data for event in events] == [True, False, True, False]
    assert statuses(read(events[:3])) == {"again": "INVALID"}


def test_the_text_shows_each_node_under_its_parent_with_a_symbol_and_its_words(make_session, scripted):
    first = scripted("S", "first")
    first.feedback_message = "done with it"
    state = read(run(make_session, Sequence("both", True, [first, scripted("RF", "second")])))

    assert state.as_text().splitlines() == ["✗ both", "    ✓ first  (done with it)", "    ✗ second"]


def test_changes_of_a_tree_that_never_began_are_ignored():
    state = TreeState()
    changes = Event(1.0, EventKind.TREE, "tree", {"tree": "unknown", "tick": 4, "changes": [[3, "RUNNING", ""]]})

    assert state.take(changes)
    assert (state.name, state.nodes, state.as_text()) == ("", [], "")
    assert not state.take(Event(1.0, EventKind.CUSTOM, "tree", {}))


def test_every_status_has_a_symbol():
    assert set(SYMBOLS) == {status.value for status in Status}
