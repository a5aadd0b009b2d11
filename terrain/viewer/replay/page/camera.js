// The camera: three views, and fingers, mouse and wheel that change them.
const FIELD_OF_VIEW = 0.8;  // rad, vertical
const BLEND = 0.7;  // s from one view to the next
const FOLLOW = {pitch: 0.5, lengths: 9, least: 4.5};  // m, and robot's lengths, behind the robot
const TURNING = 2.5;  // 1/s; how fast the camera follows the heading
const MARGIN = 44;  // pixels between the edge of the window and what a view is of, for labels
const LEAST_SEEN = 1.0;  // m around each point
const ROUTE_POINTS = 200;
const MUCH_FARTHER = 1.7;  // the overview is of all of the world where it is not this much farther away than the route
const MUCH_NEARER = 0.8;

class Camera {
  constructor(canvas, scene, bodies, onChange) {
    this.canvas = canvas;
    this.scene = scene;
    this.route = routePoints(scene, bodies);
    this.corners = cornersOf(scene.box);
    this.onChange = onChange;
    this.fov = FIELD_OF_VIEW;
    this.blend = 0;
    this.shown = {target: scene.route.middle, yaw: 0, pitch: 0.7, distance: 10};
    this.show('overview');
    this.shown = {...this.wanted};
    this.blend = 0;
    this.listen();
  }

  get target() { return this.shown.target; }
  get focal() { return 0.5 * this.canvas.clientHeight / Math.tan(this.fov / 2); }  // pixels

  show(view) {
    this.view = view;
    this.touched = false;
    this.from = {...this.shown};
    this.blend = BLEND;
    this.side = {yaw: 0, pitch: 0, zoom: 1};
    if (view === 'overview') {
      const {yaw} = this.scene.route, near = this.turned(this.route, yaw, 0.75), all = this.turned(this.corners, yaw, 0.75);
      this.wanted = all.distance < MUCH_FARTHER * near.distance ? all : near;
    }
    if (view === 'above') this.wanted = this.turned(this.corners, -Math.PI / 2, Math.PI / 2 - 0.001);
    this.onChange();
  }

  // The view of points from this side or, where it is from much nearer, as on an upright phone, a quarter turn on.
  turned(points, yaw, pitch) {
    const [straight, across] = [yaw, yaw - Math.PI / 2].map(angle => this.fitted(points, angle, pitch));
    return across.distance < MUCH_NEARER * straight.distance ? across : straight;
  }

  // The nearest view in this direction in which all points are inside the margins of the window.
  fitted(points, yaw, pitch) {
    const flat = Math.cos(pitch), ahead = [-flat * Math.cos(yaw), -flat * Math.sin(yaw), -Math.sin(pitch)];
    const right = [-Math.sin(yaw), Math.cos(yaw), 0], top = cross(right, ahead);
    const sides = [[right, this.canvas.clientWidth], [top, this.canvas.clientHeight]].map(([axis, pixels]) => {
      const slope = Math.max(0.5 * pixels - MARGIN, 0.25 * pixels, 1) / Math.max(this.focal, 1);
      let most = -Infinity, least = Infinity;  // of where the edges of the picture may be
      for (const point of points) {
        const to = minus(point, points[0]);
        most = Math.max(most, dot(to, axis) - slope * dot(to, ahead) + LEAST_SEEN);
        least = Math.min(least, dot(to, axis) + slope * dot(to, ahead) - LEAST_SEEN);
      }
      return {axis, shift: 0.5 * (most + least), distance: 0.5 * (most - least) / slope};
    });
    const depths = points.map(point => dot(minus(point, points[0]), ahead));
    const depth = 0.5 * (Math.max(...depths) + Math.min(...depths));  // the view turns about the middle of what is seen
    const target = sides.reduce((place, {axis, shift}) => plus(place, axis, shift), plus(points[0], ahead, depth));
    return {target, yaw, pitch, distance: depth + Math.max(...sides.map(side => side.distance))};
  }

  follow(body, seconds) {
    if (this.view !== 'follow' || !body.at) return;
    const heading = Math.atan2(body.axes[0][1], body.axes[0][0]) + Math.PI;
    if (this.heading === undefined || this.blend === BLEND) this.heading = heading;
    const turn = Math.atan2(Math.sin(heading - this.heading), Math.cos(heading - this.heading));
    this.heading += turn * (1 - Math.exp(-TURNING * seconds));
    this.wanted = {target: plus(body.at, [0, 0, 0.3 * body.length]), yaw: this.heading + this.side.yaw,
      pitch: clamped(FOLLOW.pitch + this.side.pitch, -0.1, 1.55),
      distance: this.side.zoom * Math.max(FOLLOW.lengths * body.length, FOLLOW.least)};
  }

  // Go on towards the wanted view; true while it moves.
  advance(seconds) {
    this.blend = Math.max(0, this.blend - seconds);
    const left = this.blend / BLEND, share = 1 - left * left * (3 - 2 * left), from = this.from, to = this.wanted;
    if (share === 1 || !from) { this.shown = {...to, target: [...to.target]}; return false; }
    const turn = Math.atan2(Math.sin(to.yaw - from.yaw), Math.cos(to.yaw - from.yaw));
    this.shown = {target: from.target.map((value, k) => mixed(value, to.target[k], share)), yaw: from.yaw + share * turn,
      pitch: mixed(from.pitch, to.pitch, share), distance: from.distance * (to.distance / from.distance) ** share};
    return true;
  }

  matrices() {
    const {target, yaw, pitch, distance} = this.shown, flat = Math.cos(pitch);
    this.eye = plus(target, [flat * Math.cos(yaw), flat * Math.sin(yaw), Math.sin(pitch)], distance);
    const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1), reach = Math.hypot(...this.scene.size);
    const near = Math.max(0.05, 0.02 * distance);
    this.ahead = unit(minus(target, this.eye));
    this.right = unit(cross(this.ahead, [0, 0, 1]));
    this.top = cross(this.right, this.ahead);
    this.matrix = product(perspective(this.fov, aspect, near, 2 * distance + 3 * reach),
      lookingAt(this.eye, target, [0, 0, 1]));
    return this.matrix;
  }

  pixelsPerMetre(point) {
    return this.focal / Math.max(this.ahead ? dot(minus(point, this.eye), this.ahead) : this.shown.distance, 0.05);
  }

  // Place of a point in the window [pixels], or null behind the camera.
  project(point) {
    const m = this.matrix, w = m[3] * point[0] + m[7] * point[1] + m[11] * point[2] + m[15];
    if (w <= 0) return null;
    const [x, y] = [0, 1].map(k => (m[k] * point[0] + m[4 + k] * point[1] + m[8 + k] * point[2] + m[12 + k]) / w);
    return [0.5 * (x + 1) * this.canvas.clientWidth, 0.5 * (1 - y) * this.canvas.clientHeight];
  }

  turn(dx, dy) {
    this.touched = true;
    if (this.view === 'follow') { this.side.yaw -= 0.006 * dx; this.side.pitch = clamped(this.side.pitch + 0.006 * dy, -0.6, 1.05); }
    else {
      if (this.view === 'above') this.view = 'free';
      this.wanted.yaw -= 0.006 * dx;
      this.wanted.pitch = clamped(this.wanted.pitch + 0.006 * dy, -0.2, 1.569);
    }
    this.onChange();
  }

  pan(dx, dy) {
    this.touched = true;
    if (this.view === 'follow') this.view = 'free';
    const metres = this.wanted.distance / this.focal, yaw = this.wanted.yaw;
    const right = [-Math.sin(yaw), Math.cos(yaw), 0], ahead = [-Math.cos(yaw), -Math.sin(yaw), 0];
    this.wanted.target = plus(plus(this.wanted.target, right, -dx * metres), ahead, dy * metres);
    this.onChange();
  }

  zoom(factor) {
    this.touched = true;
    if (this.view === 'follow') this.side.zoom = clamped(this.side.zoom * factor, 0.15, 20);
    else this.wanted.distance = clamped(this.wanted.distance * factor, 0.5, 20 * Math.hypot(...this.scene.size));
    this.onChange();
  }

  listen() {
    const canvas = this.canvas, fingers = new Map();
    const framed = window.self !== window.top;
    if (framed) canvas.style.touchAction = 'pan-y';  // so that a page around this one can be scrolled
    canvas.addEventListener('contextmenu', event => event.preventDefault());
    canvas.addEventListener('pointerdown', event => {
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.setPointerCapture(event.pointerId);
    });
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, event => fingers.delete(event.pointerId));
    canvas.addEventListener('pointermove', event => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY], dx = now[0] - before[0], dy = now[1] - before[1];
      const other = [...fingers].find(([id]) => id !== event.pointerId);
      fingers.set(event.pointerId, now);
      if (other) {
        const gap = at => Math.hypot(at[0] - other[1][0], at[1] - other[1][1]);
        this.zoom(gap(before) / Math.max(gap(now), 1));
        this.pan(0.5 * dx, 0.5 * dy);
      } else if (event.buttons & 6 || event.shiftKey) this.pan(dx, dy);
      else this.turn(dx, dy);
    });
    canvas.addEventListener('wheel', event => {
      if (framed && !document.hasFocus()) return;
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * clamped(event.deltaY, -200, 200)));
    }, {passive: false});
  }
}

const cornersOf = ({middle, size}) => [0, 1, 2, 3, 4, 5, 6, 7].map(corner =>
  middle.map((value, k) => value + (corner >> k & 1 ? 0.5 : -0.5) * size[k]));

// Start, goals, and places on the tracks of all robots.
function routePoints(scene, bodies) {
  const points = scene.marks.map(mark => mark.position);
  for (const {positions} of bodies.robots)
    for (let k = 0, step = 3 * Math.ceil(positions.length / 3 / ROUTE_POINTS); k < positions.length; k += step)
      points.push([...positions.subarray(k, k + 3)]);
  return points;
}
