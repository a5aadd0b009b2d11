// Fingers, mouse, wheel and keys on the map. What moves the view never drives: only a tap, or an aimed drag, is a goal.
"use strict";

const LEAST_DRAG = 8; // pixels; less is a tap
const HOLD = 500; // ms that a finger rests before its drag gives a heading; with the mouse that is Shift
const STEP = 60; // pixels for an arrow key
const [LEAST_SCALE, MOST_SCALE] = [1, 1000]; // pixels per metre
const PANS = { ArrowLeft: [STEP, 0], ArrowRight: [-STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
const ZOOMS = { "+": 1.25, "=": 1.25, "-": 0.8 };

const pointers = new Map(); // where each finger, or the mouse, is: [x, y] in pixels
let gesture = null; // from the first finger down to the last one up; doing: "tap", "aim", "pan"

function aimedGoal() {
  return gesture?.doing === "aim" ? gesture.goal : null;
}

function pan(dx, dy) {
  view.x -= dx / view.scale;
  view.y += dy / view.scale;
}

function zoom(factor, px, py) { // the place under the pixel stays there
  const before = toMetre(px, py);
  view.scale = Math.max(LEAST_SCALE, Math.min(MOST_SCALE, view.scale * factor));
  const after = toMetre(px, py);
  view.x += before.x - after.x;
  view.y += before.y - after.y;
}

function ahead(at) { // the heading of somebody who comes straight from where the robot is
  const robot = poseOf(frames.robot_frame);
  return robot ? Math.atan2(at.y - robot.y, at.x - robot.x) : 0;
}

function aim() {
  gesture.doing = "aim";
  gesture.goal = { ...gesture.at, yaw: ahead(gesture.at) };
  redraw();
}

const spread = () => { // middle of two fingers and how far they are apart
  const [[ax, ay], [bx, by]] = [...pointers.values()];
  return { x: (ax + bx) / 2, y: (ay + by) / 2, apart: Math.max(1, Math.hypot(ax - bx, ay - by)) };
};

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  const here = [event.clientX, event.clientY];
  pointers.set(event.pointerId, here);
  clearTimeout(gesture?.timer);
  if (pointers.size > 1) {
    gesture.doing = "pan"; // whatever one finger has begun, two fingers move the view
    redraw();
    return;
  }
  gesture = { from: here, at: toMetre(...here), doing: event.button === 0 ? "tap" : "pan" };
  if (event.pointerType === "touch") gesture.timer = setTimeout(aim, HOLD);
  else if (event.shiftKey && event.button === 0) aim();
});

canvas.addEventListener("pointermove", (event) => {
  if (!pointers.has(event.pointerId)) return;
  const [before, here] = [pointers.get(event.pointerId), [event.clientX, event.clientY]];
  const [dx, dy] = [here[0] - gesture.from[0], here[1] - gesture.from[1]];
  if (pointers.size === 2) {
    const old = spread();
    pointers.set(event.pointerId, here);
    const now = spread();
    pan(now.x - old.x, now.y - old.y);
    zoom(now.apart / old.apart, now.x, now.y);
  } else if (gesture.doing === "tap" && Math.hypot(dx, dy) > LEAST_DRAG) {
    clearTimeout(gesture.timer);
    gesture.doing = "pan";
    pan(dx, dy);
  } else if (gesture.doing === "pan" && pointers.size === 1) pan(here[0] - before[0], here[1] - before[1]);
  else if (gesture.doing === "aim" && Math.hypot(dx, dy) > LEAST_DRAG) gesture.goal.yaw = Math.atan2(-dy, dx);
  pointers.set(event.pointerId, here);
  redraw();
});

function lift(event, ends) {
  if (!pointers.delete(event.pointerId) || pointers.size > 0) return;
  clearTimeout(gesture.timer);
  const { doing, goal, at } = gesture;
  gesture = null;
  if (ends && doing === "aim") sendGoal(goal);
  if (ends && doing === "tap") sendGoal({ ...at, yaw: ahead(at) });
  redraw();
}
canvas.addEventListener("pointerup", (event) => lift(event, true));
canvas.addEventListener("pointercancel", (event) => lift(event, false));
canvas.addEventListener("contextmenu", (event) => event.preventDefault());

canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-event.deltaY / 500), event.clientX, event.clientY);
  redraw();
}, { passive: false });

canvas.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in PANS || event.key in ZOOMS)) return;
  event.preventDefault();
  if (event.key in PANS) pan(...PANS[event.key]);
  else zoom(ZOOMS[event.key], innerWidth / 2, innerHeight / 2);
  redraw();
});

addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || !gesture) return;
  clearTimeout(gesture.timer);
  gesture.doing = "pan"; // no goal comes of it
  redraw();
});
