// Paints, as in terrain/viewer/replay/world_mesh.py: 0 ground by its slope, 1 floor, 2 walls, 3 obstacles.
// The colour of ground is that of its slope, face by face, so that it does not blur where a ramp begins.
const LIT = `#version 300 es
precision highp float;
precision highp sampler2DShadow;
uniform sampler2DShadow shadows;
uniform mat4 toLight;
uniform vec3 light;
uniform vec3 eye;
uniform float cut;
float sun(vec3 at, vec3 normal) {
  vec3 place = (toLight * vec4(at + 0.06 * normal, 1.0)).xyz * 0.5 + 0.5;
  if (any(lessThan(place, vec3(0.0))) || any(greaterThan(place, vec3(1.0)))) return 1.0;
  float texel = 1.2 / float(textureSize(shadows, 0).x), sum = 0.0;
  for (int k = 0; k < 4; k++)
    sum += texture(shadows, vec3(place.xy + texel * vec2(k % 2 * 2 - 1, k / 2 * 2 - 1), place.z - 0.0012));
  return 0.25 * sum;
}
vec3 lit(vec3 colour, vec3 at, vec3 normal) {
  float direct = max(dot(normal, light), 0.0);
  return colour * (0.5 + 0.12 * normal.z + 0.5 * direct * (direct > 0.0 ? sun(at, normal) : 1.0));
}
vec3 faceNormal(vec3 at) {
  vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
  return dot(normal, eye - at) < 0.0 ? -normal : normal;
}
`;

const WORLD_VERTEX = `#version 300 es
layout(location = 0) in vec3 fraction;
layout(location = 1) in float paint;
layout(location = 2) in vec3 smoothNormal;
layout(location = 3) in float costStep;
uniform mat4 view;
uniform vec3 size;
uniform float steps;
out vec3 at;
out vec3 normal;
out vec3 cost;  // share of the scale, forbidden, not on the map
flat out float kind;
void main() {
  at = fraction * size; normal = smoothNormal; kind = paint; gl_Position = view * vec4(at, 1.0);
  cost = vec3(min(costStep / max(steps, 1.0), 1.0), abs(costStep - steps - 1.0) < 0.5, costStep > steps + 1.5);
}`;

const WORLD_FRAGMENT = LIT + `
uniform vec3 paints[4];
uniform vec3 slopes[5];
uniform float stops[5];
uniform float contour;
uniform float steps;
uniform vec3 forbidden;
uniform vec3 nowhere;
in vec3 at;
in vec3 normal;
in vec3 cost;
flat in float kind;
out vec4 colour;
// A face is forbidden, or not on the map, where one of its corners is; as in the picture of the layers.
vec3 costColour() {
  if (cost.z > 1e-4) return nowhere;
  if (cost.y > 1e-4) return forbidden;
  vec3 found = slopes[0];
  for (int k = 1; k < 5; k++) found = mix(found, slopes[k], clamp(4.0 * cost.x - float(k - 1), 0.0, 1.0));
  return found;
}
vec3 slopeColour(float angle) {
  vec3 found = slopes[0];
  for (int k = 1; k < 5; k++) found = mix(found, slopes[k], clamp((angle - stops[k - 1]) / (stops[k] - stops[k - 1]), 0.0, 1.0));
  return found;
}
void main() {
  if (at.z > cut) discard;
  vec3 face = faceNormal(at), rounded = normalize(normal);
  bool ground = kind < 1.5;
  if (!ground && !gl_FrontFacing) { colour = vec4(0.16, 0.17, 0.2, 1.0); return; }  // the inside of what is cut open
  if (dot(rounded, face) < 0.0) rounded = -rounded;
  vec3 shown = ground && dot(rounded, face) > 0.93 ? rounded : face;
  vec3 paint = paints[int(kind + 0.5)];
  if (steps > 0.0 && ground) paint = costColour();
  else if (kind < 0.5) paint = slopeColour(degrees(acos(clamp(abs(shown.z), 0.0, 1.0))));
  if (kind < 0.5) {
    if (contour > 0.0) {
      float height = at.z / contour, wide = fwidth(height);
      float line = 1.0 - smoothstep(0.0, 1.2 * wide, abs(fract(height + 0.5) - 0.5));
      paint *= 1.0 - 0.15 * line * (1.0 - smoothstep(0.15, 0.4, wide)) * smoothstep(0.02, 0.06, length(shown.xy));
    }
  }
  bool below = ground && face.z < 0.0;  // a ceiling
  colour = vec4(below ? paint * 0.5 : lit(paint, at, shown), 1.0);
}`;

const DEPTH_FRAGMENT = `#version 300 es
precision highp float;
uniform float cut;
in vec3 at;
in vec3 normal;
flat in float kind;
void main() { if (at.z > cut) discard; }`;

const BODY_VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 paint;
uniform mat4 view;
uniform vec3 eye;
uniform float nearer;
out vec3 at;
out vec4 shade;
void main() { at = position; shade = paint; gl_Position = view * vec4(at + nearer * normalize(eye - at), 1.0); }`;

const BODY_FRAGMENT = LIT + `
uniform float share;
in vec3 at;
in vec4 shade;
out vec4 colour;
void main() { if (at.z > cut) discard; colour = vec4(lit(shade.rgb, at, faceNormal(at)), share * shade.a); }`;

// Discs on the ground: contact shade (solid 0), rings around robots and goals (solid 1).
const DISC_VERTEX = `#version 300 es
layout(location = 0) in vec3 centre;
layout(location = 1) in vec3 right;
layout(location = 2) in vec3 ahead;
layout(location = 3) in vec4 paint;
layout(location = 4) in float solid;
uniform mat4 view;
out vec2 place;
out vec4 shade;
flat out float kind;
out float height;
void main() {
  place = vec2(gl_VertexID % 2, gl_VertexID / 2) * 2.0 - 1.0;
  shade = paint; kind = solid;
  vec3 at = centre + right * place.x + ahead * place.y;
  height = at.z;
  gl_Position = view * vec4(at, 1.0);
  gl_Position.z -= 0.0006 * gl_Position.w;
}`;

const DISC_FRAGMENT = `#version 300 es
precision highp float;
uniform float cut;
in vec2 place;
in vec4 shade;
flat in float kind;
in float height;
out vec4 colour;
void main() {
  float far = length(place), wide = fwidth(far);
  float soft = (1.0 - smoothstep(0.25, 1.0, far));
  float ring = smoothstep(0.8 - wide, 0.8, far) * (1.0 - smoothstep(1.0 - wide, 1.0, far));
  if (height > cut || far > 1.0) discard;
  colour = vec4(shade.rgb, shade.a * (kind < 0.5 ? soft : ring));
}`;

// A piece of a line as a capsule of a width in pixels; dashes where dash > 0 [m]. Faint pieces have no round ends,
// because they would show where they lie over each other.
const LINE_VERTEX = `#version 300 es
layout(location = 0) in vec4 begin;
layout(location = 1) in vec4 end;
uniform mat4 view;
uniform vec2 window;
uniform float halfWidth;
uniform float lift;
uniform float cut;
uniform vec4 paint;
out vec3 place;
out float along;
out float height;
flat out float pixels;
void main() {
  vec4 a = view * vec4(begin.xyz + vec3(0.0, 0.0, lift), 1.0), b = view * vec4(end.xyz + vec3(0.0, 0.0, lift), 1.0);
  float near = 0.05;
  if (a.w < near && b.w < near) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  if (a.w < near) a = mix(b, a, (b.w - near) / (b.w - a.w));
  if (b.w < near) b = mix(a, b, (a.w - near) / (a.w - b.w));
  vec2 from = a.xy / a.w * 0.5 * window, to = b.xy / b.w * 0.5 * window, way = to - from;
  pixels = length(way);
  vec2 ahead = pixels > 1e-4 ? way / pixels : vec2(1.0, 0.0), aside = vec2(-ahead.y, ahead.x);
  float side = float(gl_VertexID % 2 * 2 - 1), atEnd = float(gl_VertexID / 2);
  vec4 corner = atEnd < 0.5 ? a : b;
  height = mix(begin.z, end.z, atEnd);
  float cap = height > cut || paint.a < 1.0 ? 0.0 : halfWidth;
  vec2 shift = aside * side * halfWidth + ahead * (atEnd * 2.0 - 1.0) * cap;
  gl_Position = corner + vec4(shift / (0.5 * window) * corner.w, 0.0, 0.0);
  place = vec3(mix(-cap, pixels + cap, atEnd), side * halfWidth, 1.0) * corner.w;
  along = mix(begin.w, end.w, mix(-cap, pixels + cap, atEnd) / max(pixels, 1e-3));
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
uniform float halfWidth;
uniform float dash;
uniform float cut;
uniform vec4 paint;
in vec3 place;
in float along;
in float height;
flat in float pixels;
out vec4 colour;
void main() {
  vec2 at = place.xy / place.z;
  float beside = length(vec2(at.x - clamp(at.x, 0.0, pixels), at.y));
  float alpha = paint.a * (1.0 - smoothstep(halfWidth - 1.0, halfWidth, beside)) * (height > cut ? 0.22 : 1.0);
  if (alpha < 0.01 || dash > 0.0 && fract(along / dash) > 0.62) discard;
  colour = vec4(paint.rgb, alpha);
}`;

const POINT_VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
uniform mat4 view;
uniform float scale;
out float height;
void main() {
  gl_Position = view * vec4(position, 1.0);
  gl_PointSize = clamp(scale / gl_Position.w, 3.0, 9.0);
  height = position.z;
}`;

const POINT_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 paint;
uniform float cut;
in float height;
out vec4 colour;
void main() {
  if (length(gl_PointCoord - 0.5) > 0.5 || height > cut) discard;
  colour = paint;
}`;

const SKY_VERTEX = `#version 300 es
out vec2 place;
void main() { place = vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0; gl_Position = vec4(place, 0.9999, 1.0); }`;

const SKY_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 ahead;
uniform vec3 right;
uniform vec3 top;
in vec2 place;
out vec4 colour;
void main() {
  float rise = normalize(ahead + place.x * right + place.y * top).z;
  vec3 horizon = vec3(0.93, 0.95, 0.97), zenith = vec3(0.55, 0.72, 0.91), low = vec3(0.80, 0.84, 0.87);
  colour = vec4(rise > 0.0 ? mix(horizon, zenith, sqrt(rise)) : mix(horizon, low, sqrt(-rise)), 1.0);
}`;
