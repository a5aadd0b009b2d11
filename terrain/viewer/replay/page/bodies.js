// What moves: robots, people, doors. All of their triangles are one buffer and one draw call, as are the discs under them.
const LEAST_ROBOT = 26;  // pixels; robots farther away are drawn larger than they are
const LEAST_PERSON = 12;
const MOST_ENLARGED = 12;
const SEEN_THROUGH = 90;  // of 255; what stands between the eye and the robot that the camera follows
const HIDDEN_ROBOT = 0.4;  // share of its colour that a robot has behind walls

class Bodies {
  constructor(drawing, scene, arrays) {
    const gl = drawing.gl;
    this.drawing = drawing;
    this.times = fromMilli(arrays[scene.times]);
    this.robots = scene.robots.map(robot => ({...robot, ...moving(robot, arrays)}));
    this.actors = scene.actors.map(actor => ({...actor, ...moving(actor, arrays)}));
    this.all = [...this.actors, ...this.robots];
    const corners = this.all.reduce((sum, body) => sum + body.corners, 0);
    this.bytes = new ArrayBuffer(16 * corners);
    this.triangles = {floats: new Float32Array(this.bytes), colours: new Uint8Array(this.bytes)};
    this.buffer = drawing.buffer(this.bytes, gl.ARRAY_BUFFER, gl.DYNAMIC_DRAW);
    this.array = drawing.layout(this.buffer, 16, [[0, 3, gl.FLOAT, false, 0], [1, 4, gl.UNSIGNED_BYTE, true, 12]]);
    this.program = drawing.program(BODY_VERTEX, BODY_FRAGMENT);
    this.discBuffer = drawing.buffer(new Float32Array(11));
    this.discArray = drawing.layout(this.discBuffer, 44, [[0, 3, gl.FLOAT, false, 0], [1, 3, gl.FLOAT, false, 12],
      [2, 3, gl.FLOAT, false, 24], [3, 4, gl.UNSIGNED_BYTE, true, 36], [4, 1, gl.FLOAT, false, 40]], 1);
    this.discProgram = drawing.program(DISC_VERTEX, DISC_FRAGMENT);
  }

  // Move everything to where it is at a time, as large as it must be to be seen. The robots come first and what hides the
  // followed one last, so that one call draws all of it through what hides it.
  place(time, camera, followed) {
    const at = clamped(lastUpTo(this.times, time), 0, Math.max(this.times.length - 2, 0));
    const step = this.times.length > 1 ? this.times[at + 1] - this.times[at] : 1;
    const share = this.times.length > 1 ? clamped((time - this.times[at]) / step, 0, 1) : 0;
    this.discs = [];
    const placed = this.all.filter(body => body.positions.length);
    for (const body of placed) {
      body.at = [0, 1, 2].map(k => mixed(body.positions[3 * at + k], body.positions[3 * (at + (share ? 1 : 0)) + k], share));
      const row = index => Array.from(body.orientations.subarray(4 * index, 4 * index + 4), value => value / 32767);
      body.axes = axes(share ? between(row(at), row(at + 1), share) : between(row(at), row(at), 0));
      body.scale = clamped(leastPixels(body) / (camera.pixelsPerMetre(body.at) * body.length), 1, MOST_ENLARGED);
      this.addDiscs(body);
    }
    const hiding = placed.filter(body => !body.ring && followed && followed.at && isBetween(body, camera.eye, followed));
    const put = (corner, body) => this.put(body, at, share, corner, hiding.includes(body) ? SEEN_THROUGH : 255);
    this.robotCorners = placed.filter(body => body.ring).reduce(put, 0);
    this.corners = [...placed.filter(body => !body.ring && !hiding.includes(body)), ...hiding].reduce(put, this.robotCorners);
    this.frame = at + (share > 0.5 ? 1 : 0);
  }

  put(body, at, share, corner, alpha) {
    const [x, y, z] = body.axes, {floats, colours} = this.triangles;
    for (const {corners, colour, wheel} of body.shapes) {
      const turn = wheel < 0 ? 0 : mixed(body.angles[body.wheels.length * at + wheel],
        body.angles[body.wheels.length * (at + (share ? 1 : 0)) + wheel], share);
      const [middle, , top] = wheel < 0 ? [0, 0, 0] : body.wheels[wheel], c = Math.cos(turn), s = Math.sin(turn);
      for (let k = 0; k < corners.length; k += 3, corner++) {
        const dx = corners[k] - middle, dz = corners[k + 2] - top;
        const px = body.scale * (middle + c * dx + s * dz), pz = body.scale * (top - s * dx + c * dz);
        const py = body.scale * corners[k + 1];
        for (let axis = 0; axis < 3; axis++)
          floats[4 * corner + axis] = body.at[axis] + px * x[axis] + py * y[axis] + pz * z[axis];
        colours.set([...colour, alpha], 16 * corner + 12);
      }
    }
    return corner;
  }

  addDiscs(body) {
    const [x, y, z] = body.axes, ground = plus(body.at, z, body.foot * body.scale + 0.04), r = body.reach * body.scale;
    const disc = (radius, colour, alpha, solid) =>
      this.discs.push([ground, x.map(v => v * radius), y.map(v => v * radius), [...colour, alpha], solid]);
    disc(1.5 * r, [20, 24, 30], 150, 0);
    if (body.ring && body.scale > 1.05) disc(1.7 * r, body.ring, 230, 1);
  }

  // Robots behind walls, faint; the world is drawn, nothing else yet.
  drawHidden(common) {
    const {drawing} = this, gl = drawing.gl;
    drawing.fill(this.buffer, this.bytes);
    drawing.use(this.program, {...common, share: HIDDEN_ROBOT, nearer: Math.max(...this.robots.map(nearness))});
    gl.bindVertexArray(this.array);
    gl.depthFunc(gl.GREATER);
    gl.depthMask(false);
    gl.enable(gl.CULL_FACE);
    drawing.corners(this.robotCorners);
    gl.disable(gl.CULL_FACE);
    gl.depthMask(true);
    gl.depthFunc(gl.LEQUAL);
  }

  draw(common, marks) {
    const {drawing} = this;
    const discs = [...marks, ...this.discs];
    const bytes = new ArrayBuffer(44 * discs.length), floats = new Float32Array(bytes), colours = new Uint8Array(bytes);
    discs.forEach(([centre, right, ahead, colour, solid], k) => {
      floats.set([...centre, ...right, ...ahead, 0, solid], 11 * k);
      colours.set(colour, 44 * k + 36);
    });
    drawing.fill(this.discBuffer, bytes);
    drawing.use(this.discProgram, common);
    drawing.gl.bindVertexArray(this.discArray);
    drawing.gl.depthMask(false);
    drawing.quads(discs.length);
    drawing.gl.depthMask(true);
    drawing.use(this.program, {...common, share: 1, nearer: 0});
    drawing.gl.bindVertexArray(this.array);
    drawing.corners(this.corners);
  }
}

// How much nearer to the eye [m] a robot must be hidden still: its wheels may sink in a little.
const nearness = body => 0.4 * body.length * (body.scale || 1);

// Whether a body stands in the way from the eye to a robot, seen from above.
function isBetween(body, eye, robot) {
  if (!eye) return false;
  const way = minus(robot.at, eye), to = minus(body.at, eye), flat = Math.hypot(way[0], way[1]) || 1;
  const along = (to[0] * way[0] + to[1] * way[1]) / flat, aside = Math.abs(to[0] * way[1] - to[1] * way[0]) / flat;
  const height = eye[2] + way[2] * along / flat - body.at[2];  // of the line of sight where the body stands
  return along > 0 && along < flat && aside < body.reach * body.scale + robot.reach * robot.scale && height < body.tall * body.scale;
}

const leastPixels = body => body.ring ? LEAST_ROBOT : body.thing === 'person' ? LEAST_PERSON : 0;

// Shapes and poses of a body; where it stands, how far it reaches, and how long it is [m].
function moving(body, arrays) {
  const shapes = body.parts.map(part => ({corners: fromMilli(arrays[part.corners]), colour: part.colour,
    wheel: part.wheel}));
  let reach = 0.1, foot = Infinity, tall = 0;
  const first = shapes[0].corners;
  for (let k = 0; k < first.length; k += 3) {
    reach = Math.max(reach, Math.hypot(first[k], first[k + 1]));
    foot = Math.min(foot, first[k + 2]);
    tall = Math.max(tall, first[k + 2]);
  }
  return {shapes, reach, tall, length: 2 * reach, foot: body.ring || foot === Infinity ? 0 : foot,
    corners: shapes.reduce((sum, shape) => sum + shape.corners.length / 3, 0),
    positions: fromMilli(arrays[body.positions]), orientations: arrays[body.orientations],
    angles: body.angles === undefined ? [] : fromMilli(arrays[body.angles])};
}
