"""Actions that one client offers and others use, of types that the server need not know."""

import json

import pytest

NAME, TYPE = "/dock", "dock_msgs/action/Dock"
WITHIN = 20.0


class Side:
    """A client on a plain WebSocket."""

    def __init__(self, socket):
        self.socket = socket

    def say(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def next(self, op):
        """Return the next frame, which is of this kind."""
        frame = json.loads(self.socket.recv(timeout=WITHIN))
        assert frame.pop("op") == op, frame
        return frame

    def settle(self):
        """Wait until the server has done what was asked so far."""
        self.say("call_service", service="/rosapi/action_servers")
        return self.next("service_response")["values"]["action_servers"]


@pytest.fixture
def sides(serving, raw):
    """One that offers, one that sends goals, and what makes more."""
    _, server = serving()
    offering, sending = Side(raw(server.port)), Side(raw(server.port))
    offering.say("advertise_action", action=NAME, type=TYPE)
    assert NAME in offering.settle()
    return offering, sending, lambda: Side(raw(server.port))


def send(sending, goal_id="mine", **args):
    sending.say("send_action_goal", id=goal_id, action=NAME, action_type=TYPE, args=args, feedback=True)


def test_goal_feedback_and_result_pass_from_one_to_the_other(sides):
    offering, sending, _ = sides
    send(sending, bay=3)
    goal = offering.next("send_action_goal")
    passed = goal.pop("id")
    assert passed != "mine"
    assert goal == {"action": NAME, "action_type": TYPE, "args": {"bay": 3}, "feedback": True}
    offering.say("action_feedback", action=NAME, id=passed, values={"left": 2.0})
    assert sending.next("action_feedback") == {"id": "mine", "action": NAME, "values": {"left": 2.0}}
    offering.say("action_result", action=NAME, id=passed, values={"code": 7}, status=6, result=True)
    end = {"id": "mine", "action": NAME, "values": {"code": 7}, "status": 6, "result": True}
    assert sending.next("action_result") == end
    send(sending)  # its id is free again
    assert offering.next("send_action_goal")["id"] != passed


def test_a_goal_is_canceled_by_who_sent_it_and_when_who_sent_it_is_gone(sides):
    offering, sending, another = sides
    send(sending)
    first = offering.next("send_action_goal")["id"]
    sending.say("cancel_action_goal", id="mine", action=NAME)
    assert offering.next("cancel_action_goal") == {"id": first, "action": NAME}
    gone = another()
    send(gone)
    second = offering.next("send_action_goal")["id"]
    gone.socket.close()
    assert offering.next("cancel_action_goal")["id"] == second
    offering.say("action_result", action=NAME, id=second, values={}, status=5, result=True)
    offering.settle()  # there is nobody to be told, and no fault


@pytest.mark.parametrize("end", ["withdrawn", "gone", "taken over"])
def test_unfinished_goals_end_when_the_offer_does(sides, end):
    offering, sending, another = sides
    send(sending)
    offering.next("send_action_goal")
    if end == "withdrawn":
        offering.say("unadvertise_action", action=NAME)
    elif end == "gone":
        offering.socket.close()
    else:
        another().say("advertise_action", action=NAME, type=TYPE)
    result = sending.next("action_result")
    assert (result["id"], result["result"]) == ("mine", False)
    text = {"withdrawn": "was withdrawn", "gone": "has disconnected", "taken over": "another client offers"}[end]
    assert text in result["values"]


def test_what_cannot_be_offered_sent_or_answered_is_refused(sides):
    offering, sending, _ = sides
    offering.say("advertise_action", action="/navigate_to_pose", type="nav2_msgs/NavigateToPose")
    assert "is the navigator's own" in offering.next("status")["msg"]
    for op in ("action_feedback", "action_result"):
        sending.say(op, action=NAME, id="x", values={})
        assert "does not offer the action /dock" in sending.next("status")["msg"]
    offering.say("action_result", action=NAME, id="x", values={})
    assert "has no unfinished goal 'x'" in offering.next("status")["msg"]
    send(sending)
    send(sending)
    refused = sending.next("action_result")
    assert refused["result"] is False and "no unfinished goal has" in refused["values"]
