// What a web page does with roslib: `node --input-type=module - PORT CASE`; says what came of it as lines of JSON.
import * as roslib from "roslib";

const [port, name] = process.argv.slice(2);
const say = (value) => console.log(JSON.stringify(value));
const called = (start) => new Promise((resolve, reject) => start(resolve, (error) => reject(new Error(error))));
const target = (x, w = 1.0) => ({
  header: { frame_id: "map" },
  pose: { position: { x, y: 0.0, z: 0.0 }, orientation: { x: 0.0, y: 0.0, z: 0.0, w } },
});

async function connected() {
  const ros = new roslib.Ros();
  await ros.connect(`ws://127.0.0.1:${port}`);
  return ros;
}

const topic = (ros, name, messageType, more = {}) => new roslib.Topic({ ros, name, messageType, ...more });
const call = (ros, name, serviceType, request = {}) =>
  called((done, failed) => new roslib.Service({ ros, name, serviceType }).callService(request, done, failed));

/** A goal: `feedback` resolves with the first one, `end` with the result or the text of the failure. */
function sent(ros, name, actionType, values) {
  const action = new roslib.Action({ ros, name, actionType });
  const goal = { action, heard: 0 };
  goal.feedback = new Promise((heard) => {
    goal.end = new Promise((ended) => {
      goal.id = action.sendGoal(
        values,
        (result) => ended({ result }),
        (values) => ((goal.heard += 1), heard(values)),
        (failure) => ended({ failure }),
      );
    });
  });
  return goal;
}

const moveBase = (ros, x, w) =>
  sent(ros, "/move_base_flex/move_base", "mbf_msgs/action/MoveBase", { target_pose: target(x, w) });
const navigate = (ros, x) =>
  sent(ros, "/navigate_to_pose", "nav2_msgs/action/NavigateToPose", { pose: target(x), behavior_tree: "" });

/** A goal of ROS 1: an ActionClient waits for a status before it counts as connected. */
function actionlibGoal(ros, x, w) {
  const actionClient = new roslib.ActionClient({
    ros,
    serverName: "/move_base",
    actionName: "move_base_msgs/MoveBaseAction",
  });
  const goal = new roslib.Goal({ actionClient, goalMessage: { target_pose: target(x, w) } });
  const heard = new Promise((resolve) => goal.on("feedback", resolve));
  const ended = new Promise((resolve) => goal.on("status", (status) => status.status > 1 && resolve(status)));
  const result = new Promise((resolve) => goal.on("result", resolve));
  goal.send();
  return { goal, heard, ended, result };
}

const cases = {
  async topics() {
    const [ros, other] = [await connected(), await connected()];
    const moving = new Promise((resolve) =>
      topic(ros, "/odom", "nav_msgs/Odometry").subscribe(
        (message) => message.twist.twist.linear.x > 0.1 && resolve(message),
      ),
    );
    const tf = new Promise((resolve) => topic(ros, "/tf", "tf2_msgs/TFMessage").subscribe(resolve));
    const plan = new Promise((resolve) => topic(ros, "/plan", "nav_msgs/Path").subscribe(resolve));
    const heard = new Promise((resolve) => topic(ros, "/chatter", "std_msgs/String").subscribe(resolve));
    await called((...ends) => ros.getTopics(...ends)); // the subscriptions are there when it answers
    topic(other, "/chatter", "std_msgs/String").publish({ data: "hello" });
    topic(other, "/goal_pose", "geometry_msgs/PoseStamped").publish(target(0.6));
    const frames = (await tf).transforms.map((one) => one.child_frame_id);
    const end = (await plan).poses.at(-1).pose.position.x;
    say({ heard: await heard, frame: (await moving).child_frame_id, frames, end });
  },

  async services() {
    const ros = await connected();
    const parameter = new roslib.Param({ ros, name: "/move_base_flex/controller_patience" });
    await called((done, failed) => parameter.set(12.5, done, failed));
    say({
      paused: (await call(ros, "/move_base_flex/pause", "std_srvs/Trigger")).success,
      resumed: (await call(ros, "/move_base_flex/resume", "std_srvs/Trigger")).success,
      unknown: await call(ros, "/dance", "dances/Waltz").catch((error) => error.message),
      patience: await called((...ends) => parameter.get(...ends)),
      topics: (await called((...ends) => ros.getTopics(...ends))).topics,
      services: await called((...ends) => ros.getServices(...ends)),
      nodes: await called((...ends) => ros.getNodes(...ends)),
      actions: await called((...ends) => ros.getActionServers(...ends)),
      type: await called((...ends) => ros.getTopicType("/plan", ...ends)),
      fields: ros.decodeTypeDefs(
        await called((...ends) => ros.getMessageDetails("geometry_msgs/PoseStamped", ...ends)),
      ),
    });
  },

  async goals() {
    const ros = await connected();
    const [first, second] = [moveBase(ros, 0.4), undefined];
    const feedback = await first.feedback;
    const moved = (await first.end).result;
    const navigated = navigate(ros, 0.8);
    say({ distance: feedback.dist_to_goal, moved, navigated: (await navigated.end).result });
  },

  async cancel() {
    const ros = await connected();
    const one = moveBase(ros, 5.0);
    await one.feedback;
    one.action.cancelGoal(one.id);
    const first = await one.end;
    const other = navigate(ros, 5.0);
    await other.feedback;
    other.action.cancelAllGoals();
    say([first, await other.end]);
  },

  async slots() {
    const [ros, other] = [await connected(), await connected()];
    const older = moveBase(ros, 5.0);
    await older.feedback;
    const path = sent(ros, "/move_base_flex/get_path", "mbf_msgs/action/GetPath", {
      target_pose: target(1.0),
      concurrency_slot: 7,
    });
    const planned = (await path.end).result.outcome;
    const newer = moveBase(other, 6.0);
    const end = await older.end;
    newer.action.cancelGoal(newer.id);
    say({ planned, end, newer: await newer.end });
  },

  async refused() {
    const ros = await connected();
    const nonsense = await moveBase(ros, 1.0, 0.0).end;
    say([nonsense, await sent(ros, "/dance", "dances/action/Waltz", {}).end]);
  },

  async actionlib() {
    const ros = await connected();
    const { heard, ended, result } = actionlibGoal(ros, 0.6);
    const { base_position } = await heard;
    say({ frame: base_position.header.frame_id, status: (await ended).status, result: await result });
  },

  async actionlib_cancel() {
    const ros = await connected();
    const { goal, heard, ended } = actionlibGoal(ros, 5.0);
    await heard;
    goal.cancel();
    const { status, text } = await ended;
    const refused = await actionlibGoal(ros, 1.0, 0.0).ended;
    say([status, text, refused.status, refused.text]);
  },

  async offered() {
    const [ros, other] = [await connected(), await connected()];
    const dock = new roslib.Action({ ros, name: "/dock", actionType: "dock_msgs/action/Dock" });
    dock.advertise(
      ({ bay }, id) => (dock.sendFeedback(id, { left: 2.0 }), bay && dock.setSucceeded(id, { bay })),
      (id) => dock.setCanceled(id, { bay: -1 }),
    );
    await called((...ends) => ros.getActionServers(...ends)); // the offer is there when it answers
    const parked = sent(other, "/dock", "dock_msgs/action/Dock", { bay: 3 });
    const left = await parked.feedback;
    const canceled = sent(other, "/dock", "dock_msgs/action/Dock", { bay: 0 });
    await canceled.feedback;
    canceled.action.cancelGoal(canceled.id);
    say([left, await parked.end, await canceled.end]);
  },

  async drive() {
    await moveBase(await connected(), 5.0).feedback;
    say("driving");
    await new Promise(() => setInterval(() => {}, 1000)); // until it is killed
  },
};

await cases[name]();
process.exit();
