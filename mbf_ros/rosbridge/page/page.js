// A client of rosbridge without any library: what it subscribes to, calls and sends is all there is to the protocol.
"use strict";

const NODE = "/move_base_flex";
const NARROW = 600; // pixels; as in page.css
const element = (id) => document.getElementById(id);
const canvas = element("map");
const pen = canvas.getContext("2d");

const state = { transforms: {}, grid: null, mesh: null, costs: null, ground: null, scan: null, plan: [], goal: null };
const view = { x: 0, y: 0, scale: 30, placed: false }; // centre [m] and pixels per metre
const frames = { robot_frame: "base_link", global_frame: "map" };
let socket = null;
let nextId = 1;
let goalId = null; // of the goal that this page has sent
let drawing = false;

// ---------------------------------------------------------------------------------------------------- rosbridge
function connect() {
  const address = location.href.replace(/^http/, "ws").replace(/[^/]*$/, ""); // with the token, if there is one
  socket = new WebSocket(address);
  socket.onopen = () => {
    show("connection", "connected");
    element("connection").classList.remove("lost");
    for (const [topic, [type, , throttle]] of Object.entries(TOPICS)) {
      send({ op: "subscribe", topic, type, throttle_rate: throttle });
    }
    for (const name of Object.keys(frames)) {
      send({ op: "call_service", id: name, service: "/rosapi/get_param", args: { name: `${NODE}/${name}` } });
    }
  };
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => {
    show("connection", "connection lost, trying again");
    element("connection").classList.add("lost");
    goalId = null;
    element("cancel").disabled = true;
    setTimeout(connect, 1000);
  };
}

function send(operation) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ id: `page:${nextId++}`, ...operation }));
}

function take(message) {
  if (message.op === "publish") TOPICS[message.topic]?.[1](message.msg);
  else if (message.op === "action_feedback" && message.id === goalId) takeFeedback(message.values);
  else if (message.op === "action_result" && message.id === goalId) takeResult(message);
  else if (message.op === "service_response" && message.result === false) show("result", message.values);
  else if (message.op === "service_response" && message.id in frames) frames[message.id] = JSON.parse(message.values.value);
  else if (message.op === "status") show("result", message.msg);
  redraw();
}

// Type, what takes a message, and the least time between two messages [ms]. A map has some of the last five only.
const TOPICS = {
  "/tf": ["tf2_msgs/TFMessage", takeTransforms, 50],
  "/tf_static": ["tf2_msgs/TFMessage", takeTransforms, 0],
  "/cmd_vel": ["", takeCommand, 100],
  "/plan": ["nav_msgs/Path", (path) => { state.plan = path.poses.map((one) => one.pose.position); }, 100],
  "/scan": ["sensor_msgs/LaserScan", (scan) => { state.scan = scan; }, 200],
  [`${NODE}/current_goal`]: ["geometry_msgs/PoseStamped", (goal) => { state.goal = flat(goal.pose.position, goal.pose.orientation); }, 0],
  "/global_costmap/costmap": ["nav_msgs/OccupancyGrid", (grid) => { state.grid = grid; makeGround(); }, 1000],
  [`${NODE}/mesh`]: ["mesh_msgs/MeshGeometryStamped", (mesh) => { state.mesh = mesh.mesh_geometry; makeGround(); }, 1000],
  [`${NODE}/vertex_costs`]: ["mesh_msgs/MeshVertexCostsStamped", (costs) => { state.costs = costs.mesh_vertex_costs.costs; makeGround(); }, 1000],
};

// ------------------------------------------------------------------------------------------------------ messages
function flat(position, q) {
  return { x: position.x, y: position.y, yaw: Math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z)) };
}

function takeTransforms(message) {
  for (const one of message.transforms) {
    const { translation, rotation } = one.transform;
    state.transforms[one.child_frame_id] = { parent: one.header.frame_id, ...flat(translation, rotation) };
  }
  const robot = poseOf(frames.robot_frame);
  if (robot) show("pose", `${robot.x.toFixed(2)}, ${robot.y.toFixed(2)} m, ${(robot.yaw * 180 / Math.PI).toFixed(0)}°`);
}

function poseOf(frame) { // in the frame at the root of the tree, seen from above
  let pose = { x: 0, y: 0, yaw: 0 };
  for (let step = state.transforms[frame], depth = 0; step && depth < 20; step = state.transforms[step.parent], depth++) {
    const [c, s] = [Math.cos(step.yaw), Math.sin(step.yaw)];
    pose = { x: step.x + c * pose.x - s * pose.y, y: step.y + s * pose.x + c * pose.y, yaw: step.yaw + pose.yaw };
  }
  return state.transforms[frame] ? pose : null;
}

function takeCommand(message) { // a Twist or a TwistStamped
  const twist = message.twist ?? message;
  show("command", `${twist.linear.x.toFixed(2)} m/s, ${twist.angular.z.toFixed(2)} rad/s`);
}

function takeFeedback(values) {
  if (values.distance_remaining !== null) show("distance", `${values.distance_remaining.toFixed(1)} m`);
}

function takeResult(message) {
  goalId = null;
  element("cancel").disabled = true;
  const text = { 4: "arrived", 5: "canceled", 6: message.values.error_msg }[message.status];
  show("result", message.result ? text : message.values);
  show("goal", "none");
  show("distance", "-");
  state.goal = null;
  state.plan = []; // nobody drives it any more
}

function sendGoal(goal) {
  goalId = `goal:${nextId++}`;
  const orientation = { x: 0, y: 0, z: Math.sin(goal.yaw / 2), w: Math.cos(goal.yaw / 2) };
  const pose = { header: { frame_id: frames.global_frame }, pose: { position: { x: goal.x, y: goal.y, z: groundAt(goal.x, goal.y) }, orientation } };
  const action = { action: "/navigate_to_pose", action_type: "nav2_msgs/action/NavigateToPose" };
  send({ op: "send_action_goal", id: goalId, ...action, args: { pose }, feedback: true });
  state.goal = goal;
  show("goal", `${goal.x.toFixed(2)}, ${goal.y.toFixed(2)} m`);
  show("result", "");
  element("cancel").disabled = false;
}

// -------------------------------------------------------------------------------------------------------- ground
function makeGround() { // an image of the map, with its place in metres
  if (state.grid) state.ground = gridImage(state.grid);
  else if (state.mesh && state.costs) state.ground = meshImage(state.mesh, state.costs);
  if (state.ground && !view.placed) {
    const g = state.ground;
    const covered = innerWidth < NARROW ? innerHeight - element("panel").getBoundingClientRect().top : 0; // by the panel below
    view.scale = 0.9 * Math.min(innerWidth / g.width, (innerHeight - covered) / g.height);
    Object.assign(view, { x: g.x + g.width / 2, y: g.y + g.height / 2 - covered / 2 / view.scale, placed: true });
  }
}

function image(width, height) {
  const made = document.createElement("canvas");
  [made.width, made.height] = [width, height];
  return made;
}

function gridImage({ info, data }) {
  const made = image(info.width, info.height);
  const pixels = new ImageData(info.width, info.height);
  data.forEach((cost, i) => {
    const at = 4 * ((info.height - 1 - Math.floor(i / info.width)) * info.width + i % info.width);
    const grey = cost < 0 ? 205 : cost >= 100 ? 40 : 255 - 1.4 * cost;
    pixels.data.set([grey, cost < 0 ? 205 : grey, cost < 0 ? 205 : Math.min(255, grey + 0.3 * Math.max(cost, 0)), 255], at);
  });
  made.getContext("2d").putImageData(pixels, 0, 0);
  const { x, y } = info.origin.position;
  return { picture: made, x, y, width: info.width * info.resolution, height: info.height * info.resolution };
}

function meshImage({ vertices, faces }, costs) {
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const v of vertices) [x0, y0, x1, y1] = [Math.min(x0, v.x), Math.min(y0, v.y), Math.max(x1, v.x), Math.max(y1, v.y)];
  const scale = 1600 / Math.max(x1 - x0, y1 - y0);
  const made = image(Math.ceil((x1 - x0) * scale), Math.ceil((y1 - y0) * scale));
  const paint = made.getContext("2d");
  for (const { vertex_indices: corners } of faces) {
    const cost = Math.min(1, corners.reduce((sum, i) => sum + (costs[i] === null ? 1 : Math.min(1, costs[i])), 0) / 3);
    paint.fillStyle = paint.strokeStyle = `hsl(${120 - 120 * cost} 35% ${75 - 25 * cost}%)`;
    paint.beginPath();
    for (const i of corners) paint.lineTo((vertices[i].x - x0) * scale, (y1 - vertices[i].y) * scale);
    paint.closePath();
    paint.fill();
    paint.stroke();
  }
  return { picture: made, x: x0, y: y0, width: x1 - x0, height: y1 - y0, heights: vertices };
}

function groundAt(x, y) { // height of the nearest vertex; a map of cells is level
  let [best, height] = [Infinity, 0];
  for (const v of state.ground?.heights ?? []) {
    const d = (v.x - x) ** 2 + (v.y - y) ** 2;
    if (d < best) [best, height] = [d, v.z];
  }
  return height;
}

// ------------------------------------------------------------------------------------------------------- drawing
const toPixel = (p) => [innerWidth / 2 + (p.x - view.x) * view.scale, innerHeight / 2 - (p.y - view.y) * view.scale];
const toMetre = (px, py) => ({ x: view.x + (px - innerWidth / 2) / view.scale, y: view.y - (py - innerHeight / 2) / view.scale });

function redraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => { drawing = false; draw(); });
}

function draw() {
  const ratio = devicePixelRatio;
  [canvas.width, canvas.height] = [innerWidth * ratio, innerHeight * ratio];
  pen.scale(ratio, ratio);
  if (state.ground) {
    const [left, top] = toPixel({ x: state.ground.x, y: state.ground.y + state.ground.height });
    pen.imageSmoothingEnabled = view.scale < 40;
    pen.drawImage(state.ground.picture, left, top, state.ground.width * view.scale, state.ground.height * view.scale);
  }
  drawScan();
  drawPlan();
  const aimed = aimedGoal() ?? state.goal;
  if (aimed) arrow(aimed, "#c62828", 18);
  const robot = poseOf(frames.robot_frame);
  if (robot) arrow(robot, "#1565c0", 22);
}

function drawScan() {
  const sensor = state.scan && poseOf(state.scan.header.frame_id);
  if (!sensor) return;
  pen.fillStyle = "#ad1457";
  state.scan.ranges.forEach((range, i) => {
    if (range === null) return;
    const angle = sensor.yaw + state.scan.angle_min + i * state.scan.angle_increment;
    const [px, py] = toPixel({ x: sensor.x + range * Math.cos(angle), y: sensor.y + range * Math.sin(angle) });
    pen.fillRect(px - 1.5, py - 1.5, 3, 3);
  });
}

function drawPlan() {
  pen.strokeStyle = "#2e7d32";
  pen.lineWidth = 3;
  pen.beginPath();
  for (const point of state.plan) pen.lineTo(...toPixel(point));
  pen.stroke();
}

function arrow(pose, color, size) {
  pen.save();
  pen.translate(...toPixel(pose));
  pen.rotate(-pose.yaw);
  pen.fillStyle = color;
  pen.strokeStyle = "#fff";
  pen.lineWidth = 2;
  pen.beginPath();
  for (const [x, y] of [[0.7, 0], [-0.5, -0.5], [-0.25, 0], [-0.5, 0.5]]) pen.lineTo(x * size, y * size);
  pen.closePath();
  pen.fill();
  pen.stroke();
  pen.restore();
}

// ------------------------------------------------------------------------------------------------------- buttons
element("cancel").addEventListener("click", () => send({ op: "cancel_action_goal", id: goalId, action: "/navigate_to_pose" }));
for (const name of ["pause", "resume"]) {
  element(name).addEventListener("click", () => send({ op: "call_service", service: `${NODE}/${name}`, args: {} }));
}
addEventListener("resize", redraw);

function show(id, text) {
  element(id).textContent = text;
}

addEventListener("DOMContentLoaded", connect); // once input.js is there, too
