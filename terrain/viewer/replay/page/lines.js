// Plans, driven tracks, what sensors see, and the velocities of what the robot knows to move. Plans are wide and
// dashed, tracks narrow and solid: no colour is needed to know one from the other. What is hidden behind something is
// drawn once more, faint.
const PLAN = {width: 7, lift: 0.12}, TRACK = {width: 3.5, lift: 0.16};  // pixels; m above the ground and its bumps
const ARROW = {width: 4, lift: 0};
const BORDER = 1.5;  // pixels
const DASH_PIXELS = 26;
const HIDDEN = 0.25;

class Lines {
  constructor(drawing, scene, arrays, times) {
    this.drawing = drawing;
    this.times = times;
    this.program = drawing.program(LINE_VERTEX, LINE_FRAGMENT);
    this.pointProgram = drawing.program(POINT_VERTEX, POINT_FRAGMENT);
    this.scanned = paintOf(scene.scan);
    this.robots = scene.robots.map(robot => ({
      colour: paintOf(robot.ring), planned: paintOf(robot.plan), track: this.track(fromMilli(arrays[robot.positions])),
      plans: this.sets(robot.plans, arrays, points => withLengths(points)),
      scans: {...this.sets(robot.scans, arrays, points => points), hold: robot.scanHold},
      objects: this.sets(robot.objects, arrays, points => withLengths(points))}));
    this.tracked = paintOf(scene.tracked);
  }

  line(buffer, first) {
    const gl = this.drawing.gl;
    return this.drawing.layout(buffer, 16, [[0, 4, gl.FLOAT, false, 16 * first], [1, 4, gl.FLOAT, false, 16 * (first + 1)]], 1);
  }

  // Each two points are a line of their own.
  pairs(buffer, first) {
    const gl = this.drawing.gl;
    return this.drawing.layout(buffer, 32, [[0, 4, gl.FLOAT, false, 16 * first], [1, 4, gl.FLOAT, false, 16 * (first + 1)]], 1);
  }

  track(points) {
    const kept = [], frames = [];
    for (let k = 0; k < points.length / 3; k++) {
      const point = points.subarray(3 * k, 3 * k + 3), last = kept[kept.length - 1];
      if (!last || Math.hypot(...minus(point, last)) > 0.05) { kept.push(point); frames.push(this.times[k]); }
    }
    const buffer = this.drawing.buffer(withLengths(kept.flatMap(point => [...point])));
    return {times: frames, array: this.line(buffer, 0)};
  }

  // Sets of points in one buffer; only one of them is shown at a time.
  sets({times, counts, points}, arrays, laidOut) {
    const all = fromMilli(arrays[points]), parts = [], sets = [];
    let at = 0, first = 0;
    arrays[counts].forEach((count, k) => {
      const part = laidOut(all.subarray(3 * at, 3 * (at + count)));
      parts.push(part);
      sets.push({time: arrays[times][k] / 1000, first, count});
      at += count; first += count;
    });
    const joined = new Float32Array(parts.reduce((sum, part) => sum + part.length, 0));
    parts.reduce((place, part) => { joined.set(part, place); return place + part.length; }, 0);
    return {buffer: this.drawing.buffer(joined), sets, times: sets.map(set => set.time)};
  }

  newest({sets, times}, now) { return sets[lastUpTo(times, now)]; }

  draw(common, now, camera) {
    const gl = this.drawing.gl;
    const dash = 2 ** Math.round(Math.log2(DASH_PIXELS / camera.pixelsPerMetre(camera.target)));
    gl.depthMask(false);
    for (const robot of this.robots) {
      const plan = this.newest(robot.plans, now), driven = lastUpTo(robot.track.times, now);
      if (plan && plan.count > 1) {
        if (plan.array === undefined) plan.array = this.line(robot.plans.buffer, plan.first);
        this.stroke(common, plan.array, plan.count - 1, {...PLAN, colour: robot.planned, dash});
      }
      this.stroke(common, robot.track.array, driven, {...TRACK, colour: robot.colour, dash: 0});
      const known = this.newest(robot.objects, now);
      if (known && known.count) {
        if (known.array === undefined) known.array = this.pairs(robot.objects.buffer, known.first);
        this.stroke(common, known.array, known.count / 2, {...ARROW, colour: this.tracked, dash: 0});
      }
    }
    gl.depthMask(true);
    this.robots.forEach(robot => this.scan(common, robot.scans, now, camera));
  }

  // A line on a white one, and faint where something hides it.
  stroke(common, array, pieces, {width, lift, colour, dash}) {
    if (pieces < 1) return;
    const gl = this.drawing.gl;
    gl.bindVertexArray(array);
    for (const [test, wide, paint, period] of [[gl.GREATER, width, [...colour, HIDDEN], dash],
      [gl.LEQUAL, width + 2 * BORDER, [1, 1, 1, 1], 0], [gl.LEQUAL, width, [...colour, 1], dash]]) {
      gl.depthFunc(test);
      this.drawing.use(this.program, {...common, paint, halfWidth: 0.5 * wide * common.ratio, lift, dash: period});
      this.drawing.quads(pieces);
    }
  }

  scan(common, scans, now, camera) {
    const scan = this.newest(scans, now), gl = this.drawing.gl;
    if (!scan || now - scan.time > scans.hold) return;
    if (scan.array === undefined) scan.array = this.drawing.layout(scans.buffer, 12, [[0, 3, gl.FLOAT, false, 12 * scan.first]]);
    this.drawing.use(this.pointProgram, {...common, paint: [...this.scanned, 1], scale: 0.07 * camera.focal * common.ratio});
    gl.bindVertexArray(scan.array);
    this.drawing.points(scan.count);
  }
}

const paintOf = colour => colour.map(value => value / 255);

// Points x y z, each with the length of the line until it.
function withLengths(points) {
  const rows = new Float32Array(points.length / 3 * 4);
  for (let k = 0, length = 0; k < points.length / 3; k++) {
    if (k) length += Math.hypot(...[0, 1, 2].map(axis => points[3 * k + axis] - points[3 * k - 3 + axis]));
    rows.set([points[3 * k], points[3 * k + 1], points[3 * k + 2], length], 4 * k);
  }
  return rows;
}
