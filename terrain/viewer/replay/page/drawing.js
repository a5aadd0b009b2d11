// A thin layer over WebGL 2 that counts draw calls, triangles and bytes on the graphics card; see budget() in main.js.
const SHADOW_SIZE = 2048, SMALL_SHADOW_SIZE = 1024;  // pixels; the small one where the processor draws

class Drawing {
  constructor(canvas) {
    this.gl = canvas.getContext('webgl2', {antialias: true, alpha: false, powerPreference: 'high-performance'});
    if (!this.gl) throw new Error('This page needs WebGL 2, which this browser does not offer.');
    this.sizes = new Map();
    this.begin();
  }

  begin() { this.calls = 0; this.triangles = 0; }
  get bytes() { return [...this.sizes.values()].reduce((sum, size) => sum + size, 0); }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ||
      gl.getAttachedShaders(program).map(shader => gl.getShaderInfoLog(shader)).join('\n'));
    const places = {};
    for (let k = 0; k < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); k++) {
      const {name, type} = gl.getActiveUniform(program, k);
      places[name.replace('[0]', '')] = [gl.getUniformLocation(program, name), type];
    }
    return {program, places};
  }

  // Use a program with the uniforms that it has.
  use({program, places}, values) {
    const gl = this.gl;
    gl.useProgram(program);
    for (const [name, value] of Object.entries(values)) {
      if (!places[name]) continue;
      const [place, type] = places[name];
      if (type === gl.FLOAT_MAT4) gl.uniformMatrix4fv(place, false, value);
      else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, value);
      else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, value);
      else if (type === gl.FLOAT_VEC4) gl.uniform4fv(place, value);
      else if (type === gl.FLOAT) gl.uniform1fv(place, [value].flat());
      else gl.uniform1i(place, value);
    }
  }

  buffer(values, target = this.gl.ARRAY_BUFFER, usage = this.gl.STATIC_DRAW) {
    const buffer = this.gl.createBuffer();
    this.fill(buffer, values, target, usage);
    return buffer;
  }

  fill(buffer, values, target = this.gl.ARRAY_BUFFER, usage = this.gl.DYNAMIC_DRAW) {
    this.gl.bindBuffer(target, buffer);
    this.gl.bufferData(target, values, usage);
    this.sizes.set(buffer, values.byteLength);
  }

  // Vertex array of fields [place, count, type, normalised, offset] of a buffer; of one element for each instance, if wished.
  layout(buffer, stride, fields, perInstance = 0) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    for (const [place, count, type, normalised, offset] of fields) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, type, normalised, stride, offset);
      gl.vertexAttribDivisor(place, perInstance);
    }
    return array;
  }

  count(triangles) { this.calls += 1; this.triangles += triangles; }

  faces(first, indices) {
    this.gl.drawElements(this.gl.TRIANGLES, indices, this.gl.UNSIGNED_INT, 4 * first);
    this.count(indices / 3);
  }

  corners(count) { if (count) { this.gl.drawArrays(this.gl.TRIANGLES, 0, count); this.count(count / 3); } }

  quads(instances) {
    if (!instances) return;
    this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, instances);
    this.count(2 * instances);
  }

  points(count) { if (count) { this.gl.drawArrays(this.gl.POINTS, 0, count); this.count(0); } }

  shadowMap(size) {
    const gl = this.gl, texture = gl.createTexture(), frame = gl.createFramebuffer();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, size, size);
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE]]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, texture, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.sizes.set(texture, 4 * size * size);
    return frame;
  }
}
