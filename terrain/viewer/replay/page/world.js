// What does not move: one buffer of vertices, one of faces with all levels of detail, and the shadows it casts.
const LEAST_PIXELS = 2.5;  // a level of detail is coarse enough while its cells look no larger than this
const SHADOW_STEP = 0.25;  // m by which the cut may move until shadows are drawn anew

class World {
  constructor(drawing, scene, arrays, software) {
    const gl = drawing.gl;
    this.drawing = drawing;
    this.size = scene.size;
    const vertices = arrays[scene.world.vertices], paints = arrays[scene.world.paints];
    this.vertexCount = paints.length;
    this.levels = [];
    const lists = scene.world.levels.map(([cell, number]) => [cell, arrays[number]]);
    const indices = new Uint32Array(lists.reduce((sum, [, list]) => sum + list.length, 0));
    let first = 0;
    for (const [cell, list] of lists) {
      indices.set(list, first);
      this.levels.push({cell, first, count: list.length});
      first += list.length;
    }
    const packed = packedVertices(vertices, paints, normalsOf(vertices, lists[0][1], scene.size));
    this.array = drawing.layout(drawing.buffer(packed), 12, [
      [0, 3, gl.UNSIGNED_SHORT, true, 0], [1, 1, gl.UNSIGNED_BYTE, false, 6], [2, 3, gl.BYTE, true, 8]]);
    drawing.buffer(indices, gl.ELEMENT_ARRAY_BUFFER);
    gl.bindVertexArray(null);
    this.layers = scene.layers.list.map(([name, range, number]) => ({name, range, steps: arrays[number]}));
    this.steps = scene.layers.steps;
    this.program = drawing.program(WORLD_VERTEX, WORLD_FRAGMENT);
    this.depth = drawing.program(WORLD_VERTEX, DEPTH_FRAGMENT);
    this.shadowSize = software ? SMALL_SHADOW_SIZE : SHADOW_SIZE;
    this.shadows = drawing.shadowMap(this.shadowSize);
    this.shadowCut = null;
    this.looks = {size: scene.size, light: scene.light, paints: scene.paints.flat(), slopes: scene.slopes.flat(),
      stops: scene.stops, contour: scene.contour, steps: 0, forbidden: scene.layers.forbidden, nowhere: scene.layers.nowhere};
    const middle = scene.size.map(length => length / 2), half = Math.hypot(...middle);
    this.toLight = product(box(half, 0, 4 * half), lookingAt(plus(middle, scene.light, 2 * half), middle, [0, 0, 1]));
  }

  // Colours the ground by the costs of a layer, by its slopes without one.
  colourBy(layer) {
    const gl = this.drawing.gl;
    this.looks.steps = layer ? this.steps : 0;
    if (!layer) return;
    const all = new Uint8Array(this.vertexCount).fill(this.steps + 2);  // walls are on no map
    all.set(layer.steps);
    this.costs = this.costs || gl.createBuffer();
    gl.bindVertexArray(this.array);
    this.drawing.fill(this.costs, all);
    gl.enableVertexAttribArray(3);
    gl.vertexAttribPointer(3, 1, gl.UNSIGNED_BYTE, false, 1, 0);
    gl.bindVertexArray(null);
  }

  // The coarsest level that looks like the finest from this eye.
  level(eye, focal) {
    const distance = Math.hypot(...eye.map((value, k) => value - clamped(value, 0, this.size[k])));
    const fitting = this.levels.filter(({cell}) => cell * focal <= LEAST_PIXELS * distance);
    return fitting.length ? fitting[fitting.length - 1] : this.levels[0];
  }

  drawShadows(cut) {
    if (this.shadowCut !== null && (cut === this.shadowCut || Math.abs(cut - this.shadowCut) < SHADOW_STEP)) return;
    const gl = this.drawing.gl, finest = this.levels[0];
    this.shadowCut = cut;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadows);
    gl.viewport(0, 0, this.shadowSize, this.shadowSize);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.drawing.use(this.depth, {view: this.toLight, size: this.size, cut});
    gl.bindVertexArray(this.array);
    if (finest.count) this.drawing.faces(finest.first, finest.count);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  draw(common, level) {
    if (!level.count) return;
    this.drawing.use(this.program, {...common, ...this.looks});
    this.drawing.gl.bindVertexArray(this.array);
    this.drawing.faces(level.first, level.count);
  }
}

// Sums of the normals of the faces around each vertex, three numbers each.
function normalsOf(vertices, faces, size) {
  const sums = new Float32Array(vertices.length), scale = size.map(length => length / 65535);
  const corner = vertex => [0, 1, 2].map(k => vertices[3 * vertex + k] * scale[k]);
  for (let face = 0; face < faces.length; face += 3) {
    const a = corner(faces[face]), normal = cross(minus(corner(faces[face + 1]), a), minus(corner(faces[face + 2]), a));
    for (let k = 0; k < 3; k++)
      for (let axis = 0; axis < 3; axis++) sums[3 * faces[face + k] + axis] += normal[axis];
  }
  return sums;
}

function packedVertices(vertices, paints, normals) {
  const count = paints.length, bytes = new ArrayBuffer(12 * count);
  const shorts = new Uint16Array(bytes), whole = new Uint8Array(bytes), signed = new Int8Array(bytes);
  for (let k = 0; k < count; k++) {
    const normal = unit([normals[3 * k], normals[3 * k + 1], normals[3 * k + 2]]);
    for (let axis = 0; axis < 3; axis++) {
      shorts[6 * k + axis] = vertices[3 * k + axis];
      signed[12 * k + 8 + axis] = Math.round(127 * normal[axis]);
    }
    whole[12 * k + 6] = paints[k];
  }
  return bytes;
}
