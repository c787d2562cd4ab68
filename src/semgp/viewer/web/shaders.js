// What WebGL 2 runs: points into a colour and a depth image, then these shaded by depth.
const POINTS = [`#version 300 es
  layout(location = 0) in vec3 position; layout(location = 1) in float label; layout(location = 2) in float value;
  layout(location = 3) in vec3 normal; layout(location = 4) in float oneSided;
  uniform mat4 clip; uniform mat3 view; uniform vec3 low, extent, from, to; uniform float scale, smallest;
  uniform vec3 eye; uniform bool byClass, seeInside; uniform sampler2D palette, ramp;
  out vec3 colour; flat out vec3 facing; flat out vec2 distance_;
  void main() {
    vec4 class_ = texelFetch(palette, ivec2(int(label), 0), 0);
    vec3 x = low + position * extent;
    gl_Position = clip * vec4(x, 1.0);
    if (class_.a < 0.5 || any(lessThan(x, from)) || any(greaterThan(x, to))
      || seeInside && oneSided > 0.5 && dot(normal, x - eye) > 0.02 * length(x - eye)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = clamp(scale / gl_Position.w, smallest, 96.0);
    bool grey = byClass || int(label) == textureSize(palette, 0).x - 1;
    colour = grey ? class_.rgb : texelFetch(ramp, ivec2(int(value), 0), 0).rgb;
    facing = dot(normal, normal) > 0.25 ? normalize(normal * view) : vec3(0.0, 0.0, 1.0);
    colour *= dot(normal, normal) > 0.25 ? 0.78 + 0.22 * abs(dot(facing, vec3(-0.35, 0.61, -0.71))) : 0.9;
    facing *= facing.z < 0.0 ? -1.0 : 1.0;
    facing.z = max(facing.z, 0.2);
    distance_ = vec2(gl_Position.w, gl_PointSize * gl_Position.w / scale);
  }`, `#version 300 es
  precision highp float; in vec3 colour; flat in vec3 facing; flat in vec2 distance_; out vec4 fragment;
  uniform vec2 range; uniform float radius;
  void main() {  // a disc that lies in the surface
    vec2 d = vec2(2.0, -2.0) * gl_PointCoord - vec2(1.0, -1.0);
    float back = -dot(facing.xy, d) / facing.z;
    if (dot(d, d) + back * back > 1.0) discard;
    float z = max(distance_.x + back * distance_.y * radius, range.x);
    gl_FragDepth = range.y * (z - range.x) / (z * (range.y - range.x));
    fragment = vec4(colour, 1.0);
  }`];

// Eye-dome lighting (Boucheny, 2009): a pixel is darker the further it lies behind what surrounds it.
const SHADE = [`#version 300 es
  out vec2 at;
  void main() { at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0; gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0); }`,
  `#version 300 es
  precision highp float; in vec2 at; out vec4 fragment;
  uniform sampler2D image, depth; uniform vec2 range; uniform float reach, rough; uniform vec3 ground;
  float logDepth(vec2 p) {
    float z = texture(depth, p).r * 2.0 - 1.0;
    return log2(2.0 * range.x * range.y / (range.y + range.x - z * (range.y - range.x)));
  }
  vec3 shaded(vec2 p) {
    if (texture(depth, p).r == 1.0) return ground;
    vec2 texel = reach / vec2(textureSize(depth, 0));
    float here = logDepth(p), level = 0.003 + rough * exp2(-here), dark = 0.0;
    for (int i = 0; i < 8; i++) {
      float angle = 0.785398 * float(i);
      dark += clamp(here - logDepth(p + texel * vec2(cos(angle), sin(angle))) - level, 0.0, 0.12);
    }
    return texture(image, p).rgb * exp(-2.4 * dark);
  }
  void main() {
    vec2 quarter = 0.25 / vec2(textureSize(depth, 0));
    fragment = vec4(0.25 * (shaded(at + quarter * vec2(1, 1)) + shaded(at + quarter * vec2(-1, 1))
      + shaded(at + quarter * vec2(1, -1)) + shaded(at + quarter * vec2(-1, -1))), 1.0);
  }`];
