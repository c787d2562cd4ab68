"use strict";
// Shows the map in #data: points drawn by WebGL 2 into a colour and a depth image, then shaded by depth.

const $ = id => document.getElementById(id);
const map = JSON.parse($("data").textContent);
const missing = map.classes.length;
const named = [...map.classes, { name: "not observed", colour: map.missing }];
const state = { level: 0, field: map.state.field, off: new Set(map.state.hidden), size: 1, axis: 2,
  from: [0, 0, 0], to: [1, 1, 1], cutBacks: map.oriented, picked: null };

// ---- vectors -------------------------------------------------------------------------------------------------
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const unit = a => scaled(a, 1 / (Math.hypot(...a) || 1));

// ---- data ----------------------------------------------------------------------------------------------------
const TYPES = { u1: Uint8Array, i1: Int8Array, u2: Uint16Array };

async function unpack(level) {
  const packed = Uint8Array.from(atob(level.data), c => c.charCodeAt(0));
  level.data = null;
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = await new Response(stream).arrayBuffer();
  for (const [name, c] of Object.entries(level.columns)) {
    level[name] = new TYPES[c.type](raw, c.offset, level.points * c.width);
  }
  level.wide = level.columns.top.width;
  level.counts = new Array(missing + 1).fill(0);
  for (const label of level.label) level.counts[label]++;
}

// all drawing is relative to the middle of the finest level: float32 keeps its millimetres far from the origin
const finest = map.levels[0];
const middle = add(finest.low, finest.extent, 0.5);
const boxLow = finest.low.map((v, i) => Math.min(...map.levels.map(l => l.low[i])));
const boxHigh = finest.low.map((v, i) => Math.max(...map.levels.map(l => l.low[i] + l.extent[i])));
const breadth = Math.hypot(...add(boxHigh, boxLow, -1));

function probability(level, i, label) {
  const k = level.wide;
  let rest = 255;
  for (let j = 0; j < k; j++) {
    if (level.top[i * k + j] === label) return level.p[i * k + j] / 255;
    rest -= level.p[i * k + j];
  }
  return Math.max(0, rest) / 255 / (missing - k);
}

function fieldValues(level, field) {  // bytes between the ends of the field's scale
  if (field === "class") return level.label;
  if (level[field] && level.scales[field]) {
    // each level has its own variance scale; the colour bar is the finest level's
    const [low, high] = level.scales[field], s = map.fields[field];
    if (low === s.low && high === s.high) return level[field];
    return Uint8Array.from(level[field], v =>
      Math.max(0, Math.min(255, Math.round(255 * (low + v / 255 * (high - low) - s.low) / (s.high - s.low)))));
  }
  if (field === "confidence") return Uint8Array.from({ length: level.points }, (_, i) => level.p[i * level.wide]);
  const label = map.classes.findIndex(c => field === "probability of " + c.name);
  return Uint8Array.from({ length: level.points }, (_, i) => Math.round(255 * probability(level, i, label)));
}

// ---- camera: an eye that turns about a target ----------------------------------------------------------------
const up = map.up.map(Number);
const side = unit(cross(up, Math.abs(up[0]) < 0.5 ? [1, 0, 0] : [0, 1, 0]));
const ahead = cross(side, up);
const tan = Math.tan(map.fov * Math.PI / 360);
let camera;

function home() {
  const eye = add(map.eye, middle, -1), f = map.forward;
  const distance = Math.max(-dot(eye, f), 0.05 * breadth), { width, height } = free();
  camera = { target: add(eye, f, distance), distance: 1.06 * distance * Math.max(1, map.aspect * height / width),
    turn: Math.atan2(dot(f, side), dot(f, ahead)), tilt: Math.asin(Math.max(-1, Math.min(1, -dot(f, up)))) };
}

function axes() {
  const c = Math.cos(camera.tilt);
  const forward = add(add(scaled(ahead, c * Math.cos(camera.turn)), side, c * Math.sin(camera.turn)), up, -Math.sin(camera.tilt));
  const right = unit(add(scaled(side, -Math.cos(camera.turn)), ahead, Math.sin(camera.turn)));
  const flip = dot(cross(right, forward), up) < 0 ? -1 : 1;
  const r = scaled(right, flip);
  return { forward, right: r, upward: cross(r, forward), eye: add(camera.target, forward, -camera.distance) };
}

function free() {  // what the panel leaves free: width and height, and how far its middle is off, in pixels
  const w = canvas.clientWidth, covered = w > 640 ? $("panel").getBoundingClientRect().right : 0;
  return { width: w - covered, height: canvas.clientHeight, aside: covered / 2 };
}

function clipMatrix(a, aspect, near, far) {
  const sx = 1 / (tan * aspect), sy = 1 / tan, shift = 2 * free().aside / canvas.clientWidth, z = (far + near) / (far - near), w = 2 * far * near / (far - near);
  const rows = [add(scaled(a.right, sx), a.forward, shift), scaled(a.upward, sy), scaled(a.forward, z), a.forward];
  const at = [-dot(rows[0], a.eye), -dot(rows[1], a.eye), -dot(rows[2], a.eye) - w, -dot(rows[3], a.eye)];
  const m = new Float32Array(16);
  for (let r = 0; r < 4; r++) { for (let c = 0; c < 3; c++) m[4 * c + r] = rows[r][c]; m[12 + r] = at[r]; }
  return m;
}

// ---- WebGL ---------------------------------------------------------------------------------------------------
const canvas = $("view");
const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });

const POINTS = [`#version 300 es
  layout(location = 0) in vec3 position; layout(location = 1) in float label; layout(location = 2) in float value;
  layout(location = 3) in vec3 normal;
  uniform mat4 clip; uniform mat3 view; uniform vec3 low, extent, from, to; uniform float scale, smallest;
  uniform vec3 eye; uniform bool byClass, cutBacks; uniform sampler2D palette, ramp;
  out vec3 colour; flat out vec3 facing; flat out vec2 distance_;
  void main() {
    vec4 class_ = texelFetch(palette, ivec2(int(label), 0), 0);
    vec3 x = low + position * extent;
    gl_Position = clip * vec4(x, 1.0);
    if (class_.a < 0.5 || any(lessThan(x, from)) || any(greaterThan(x, to))
      || cutBacks && dot(normal, x - eye) > 0.02 * length(x - eye)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
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

function program([vertex, fragment]) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) || "no WebGL program");
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    at[name] = gl.getUniformLocation(made, name);
  }
  return { made, at };
}

function texture(unit_, filter) {
  const made = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit_);
  gl.bindTexture(gl.TEXTURE_2D, made);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  return made;
}

const PALETTE = 0, RAMP = 1, IMAGE = 2, DEPTH = 3;
let points, shade, frame, image, depth, drawnSize = "";

function begin() {
  points = program(POINTS);
  shade = program(SHADE);
  texture(PALETTE, gl.NEAREST);
  texture(RAMP, gl.NEAREST);
  image = texture(IMAGE, gl.LINEAR);
  depth = texture(DEPTH, gl.NEAREST);
  frame = gl.createFramebuffer();
  for (const level of map.levels) {
    level.vertices = gl.createVertexArray();
    gl.bindVertexArray(level.vertices);
    attribute(0, 3, level.position, true);
    attribute(1, 1, level.label, false);
    attribute(3, 3, level.normal, true);
    level.valueBuffer = attribute(2, 1, new Uint8Array(level.points), false);
    level.field = null;
  }
}

function attribute(at, width, values, normalised) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(at);
  const type = { Uint8Array: gl.UNSIGNED_BYTE, Int8Array: gl.BYTE, Uint16Array: gl.UNSIGNED_SHORT }[values.constructor.name];
  gl.vertexAttribPointer(at, width, type, normalised, 0, 0);
  return buffer;
}

const rgb = text => [1, 3, 5].map(i => parseInt(text.slice(i, i + 2), 16));

function upload() {  // what the choices change: palette, ramp, values
  const palette = new Uint8Array(named.flatMap((c, i) => [...rgb(c.colour), state.off.has(i) ? 0 : 255]));
  gl.activeTexture(gl.TEXTURE0 + PALETTE);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, named.length, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, palette);
  const level = map.levels[state.level], scale = map.fields[state.field];
  gl.activeTexture(gl.TEXTURE0 + RAMP);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const ramp = new Uint8Array(map.colourMaps[scale ? scale.colourMap : Object.keys(map.colourMaps)[0]]);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, ramp);
  if (scale && level.field !== state.field) {
    gl.bindBuffer(gl.ARRAY_BUFFER, level.valueBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, fieldValues(level, state.field), gl.STATIC_DRAW);
    level.field = state.field;
  }
}

function resize(oversampling) {
  const w = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
  const h = Math.max(1, Math.round(canvas.clientHeight * devicePixelRatio));
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const W = w * oversampling, H = h * oversampling, size = `${W} ${H}`;
  if (size !== drawnSize) {
    gl.activeTexture(gl.TEXTURE0 + IMAGE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, W, H, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.activeTexture(gl.TEXTURE0 + DEPTH);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.DEPTH_COMPONENT24, W, H, 0, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, image, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
    drawnSize = size;
  }
  return [W, H];
}

function cut() {  // the section, in the coordinates of the drawing
  const span = add(boxHigh, boxLow, -1), low = add(boxLow, middle, -1), rim = 1e-4 * breadth;
  return [state.from, state.to].map((share, end) => share.map((s, i) => low[i] + s * span[i] + (end ? rim : -rim)));
}

function draw(oversampling) {
  const [W, H] = resize(oversampling), level = map.levels[state.level], a = axes();
  const reach = Math.hypot(...add(a.eye, scaled(add(add(boxLow, boxHigh), middle, -2), 0.5), -1)) + breadth;
  const near = Math.max(0.002 * camera.distance, 1e-5 * reach), far = 1.05 * reach;
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.viewport(0, 0, W, H);
  gl.clearColor(0, 0, 0, 0);
  gl.enable(gl.DEPTH_TEST);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.useProgram(points.made);
  const [from, to] = cut();
  gl.uniformMatrix4fv(points.at.clip, false, clipMatrix(a, W / H, near, far));
  gl.uniform3fv(points.at.low, add(level.low, middle, -1));
  gl.uniform3fv(points.at.extent, level.extent);
  gl.uniform3fv(points.at.from, from);
  gl.uniform3fv(points.at.to, to);
  gl.uniformMatrix3fv(points.at.view, false, [...a.right, ...a.upward, ...a.forward]);
  gl.uniform2f(points.at.range, near, far);
  gl.uniform1f(points.at.radius, 1.05 * state.size * level.resolution);
  gl.uniform1f(points.at.scale, 2.1 * state.size * level.resolution * H / (2 * tan));
  gl.uniform1f(points.at.smallest, 1.6 * state.size * oversampling * devicePixelRatio);
  gl.uniform1i(points.at.byClass, state.field === "class" ? 1 : 0);
  gl.uniform3fv(points.at.eye, a.eye);
  gl.uniform1i(points.at.cutBacks, state.cutBacks ? 1 : 0);
  gl.uniform1i(points.at.palette, PALETTE);
  gl.uniform1i(points.at.ramp, RAMP);
  gl.bindVertexArray(level.vertices);
  gl.drawArrays(gl.POINTS, 0, level.points);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.disable(gl.DEPTH_TEST);
  gl.useProgram(shade.made);
  gl.uniform1i(shade.at.image, IMAGE);
  gl.uniform1i(shade.at.depth, DEPTH);
  gl.uniform2f(shade.at.range, near, far);
  gl.uniform1f(shade.at.rough, 1.2 * level.resolution);
  gl.uniform1f(shade.at.reach, 1.3 * oversampling * devicePixelRatio);
  gl.uniform3fv(shade.at.ground, rgb(getComputedStyle(document.documentElement).getPropertyValue("--ground").trim()).map(v => v / 255));
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  placeMark(a);
}

let pending = false, fine = 0;

function redraw() {  // at once as it is, and finer when nothing has moved for a while
  if (!pending) { pending = true; requestAnimationFrame(() => { pending = false; draw(1); }); }
  clearTimeout(fine);
  canvas.dataset.busy = "";
  fine = setTimeout(() => {
    draw(2);
    delete canvas.dataset.busy;
    canvas.dataset.drawn = String(1 + Number(canvas.dataset.drawn || 0));
  }, 160);
}

// ---- reading a point -----------------------------------------------------------------------------------------
function place(level, i) {
  return [0, 1, 2].map(k => level.low[k] + level.position[3 * i + k] / 65535 * level.extent[k]);
}

function onScreen(x, a) {
  const d = add(x, a.eye, -1), z = dot(d, a.forward), h = canvas.clientHeight, f = h / (2 * tan);
  return [canvas.clientWidth / 2 + free().aside + f * dot(d, a.right) / z, h / 2 - f * dot(d, a.upward) / z, z];
}

function backwards(level, i, sight) {
  const n = level.normal.subarray(3 * i, 3 * i + 3);
  return dot(n, sight) > 0.02 * 127 * Math.hypot(...sight);
}

function pick(x, y) {
  const level = map.levels[state.level], a = axes(), [from, to] = cut(), f = canvas.clientHeight / (2 * tan);
  let best = null, bestScore = Infinity;
  for (let i = 0; i < level.points; i++) {
    if (state.off.has(level.label[i])) continue;
    const p = add(place(level, i), middle, -1);
    if (p.some((v, k) => v < from[k] || v > to[k])) continue;
    const [u, v, z] = onScreen(p, a);
    if (z <= 0 || state.cutBacks && backwards(level, i, add(p, a.eye, -1))) continue;
    const aside = Math.hypot(u - x, v - y), reach = Math.max(7, 0.75 * state.size * level.resolution * f / z);
    if (aside > reach) continue;
    const score = z + 2 * level.resolution * aside / reach;  // the first that is met, of those the nearest
    if (score < bestScore) { best = i; bestScore = score; }
  }
  return best;
}

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

const percent = p => p >= 0.0995 ? (100 * p).toFixed(0) + " %" : (100 * p).toFixed(1) + " %";
const short = v => Math.abs(v) >= 1000 ? v.toFixed(0) : String(Number(v.toPrecision(3)));

function answer(i) {
  state.picked = i;
  $("answer").hidden = $("mark").hidden = i === null;
  redraw();
  if (i === null) return;
  const level = map.levels[state.level], k = level.wide, best = named[level.label[i]];
  const dotOf = element("span", "dot");
  dotOf.style.background = best.colour;
  $("answer-title").replaceChildren(dotOf, element("span", "", best.name));
  $("answer-place").textContent = place(level, i).map((v, c) => "xyz"[c] + " " + v.toFixed(2)).join(" · ") + " m";
  const rows = [];
  let rest = 255;
  for (let j = 0; j < k; j++) {
    const p = level.p[i * k + j];
    rest -= p;
    rows.push([map.classes[level.top[i * k + j]], p / 255]);
  }
  if (missing > k) rows.push([{ name: `${missing - k} others`, colour: map.missing }, Math.max(0, rest) / 255]);
  $("answer-rows").replaceChildren(...rows.map(([c, p]) => {
    const row = element("tr"), bar = element("div", "bar"), fill = element("div"), cell = element("td");
    fill.style.cssText = `width: ${100 * p}%; background: ${c.colour}`;
    bar.append(fill);
    cell.append(bar);
    const name = element("td", "", c.name);
    name.title = c.name;
    row.append(name, cell, element("td", "", percent(p)));
    return row;
  }));
  $("answer-facts").textContent = Object.entries(level.scales)
    .map(([name, [low, high]]) => `${name} ${short(low + level[name][i] / 255 * (high - low))}`).join(" · ");
}

function placeMark(a) {
  if (state.picked === null) return;
  const [u, v, z] = onScreen(add(place(map.levels[state.level], state.picked), middle, -1), a);
  $("mark").style.cssText = `left: ${u}px; top: ${v}px; visibility: ${z > 0 ? "visible" : "hidden"}`;
}

// ---- controls ------------------------------------------------------------------------------------------------
const metres = v => v >= 1 ? v.toFixed(2) + " m" : v >= 0.1 ? (100 * v).toFixed(0) + " cm" : (100 * v).toFixed(1) + " cm";

function segments(parent, names, chosen, choose) {
  parent.replaceChildren(...names.map((name, i) => {
    const button = element("button", "", name);
    button.type = "button";
    button.setAttribute("aria-pressed", String(i === chosen));
    button.onclick = () => choose(i);
    return button;
  }));
}

function showControls() {
  const level = map.levels[state.level], scale = map.fields[state.field];
  $("facts").textContent = `${level.points.toLocaleString("en")} points, one every ${metres(level.resolution)}`;
  $("field").value = state.field;
  $("scale").hidden = !scale;
  if (scale) {
    const bar = $("bar").getContext("2d"), ramp = map.colourMaps[scale.colourMap], row = bar.createImageData(256, 1);
    for (let i = 0; i < 256; i++) row.data.set([ramp[3 * i], ramp[3 * i + 1], ramp[3 * i + 2], 255], 4 * i);
    bar.putImageData(row, 0, 0);
    $("low").textContent = short(scale.low);
    $("high").textContent = short(scale.high) + (state.field === "entropy" ? " nats" : "");
  }
  segments($("levels"), map.levels.map(l => metres(l.resolution)), state.level, i => {
    state.level = i;
    answer(null);
    change();
  });
  segments($("axes"), ["x", "y", "z"], state.axis, i => { state.axis = i; change(); });
  const span = boxHigh[state.axis] - boxLow[state.axis];
  for (const end of ["from", "to"]) {
    $(end).value = state[end][state.axis];
    $(end + "-value").textContent = (boxLow[state.axis] + state[end][state.axis] * span).toFixed(2) + " m";
  }
  for (const entry of $("legend").children) {
    const label = Number(entry.dataset.label), on = !state.off.has(label);
    entry.firstChild.classList.toggle("off", !on);
    entry.querySelector("input").checked = on;
    entry.querySelector(".count").textContent = level.counts[label].toLocaleString("en");
    entry.hidden = !map.levels.some(l => l.counts[label]);
  }
}

function change() {
  showControls();
  upload();
  redraw();
}

function makeLegend() {
  $("legend").replaceChildren(...named.map((c, i) => {
    const entry = element("li"), label = element("label"), box = element("input"), swatch = element("span", "swatch");
    const name = element("span", "name", c.name);
    name.title = c.name;
    entry.dataset.label = String(i);
    box.type = "checkbox";
    box.onchange = () => { box.checked ? state.off.delete(i) : state.off.add(i); change(); };
    swatch.style.background = c.colour;
    label.append(box, swatch, name, element("span", "count"));
    entry.append(label);
    return entry;
  }));
}

function theme(name) {
  document.documentElement.dataset.theme = name;
  $("theme").textContent = name === "dark" ? "☀" : "☾";
  if (points) redraw();
}

function makeControls() {
  $("field").replaceChildren(...Object.keys(map.fields).map(name => {
    const option = element("option", "", name);
    option.value = name;
    return option;
  }));
  $("field").onchange = () => { state.field = $("field").value; change(); };
  $("size").oninput = () => { state.size = Number($("size").value); redraw(); };
  $("all").onclick = () => { state.off.clear(); change(); };
  $("none").onclick = () => { named.forEach((_, i) => state.off.add(i)); change(); };
  $("from").oninput = () => {
    state.from[state.axis] = Math.min(Number($("from").value), state.to[state.axis]);
    change();
  };
  $("to").oninput = () => {
    state.to[state.axis] = Math.max(Number($("to").value), state.from[state.axis]);
    change();
  };
  $("uncut").onclick = () => { state.from = [0, 0, 0]; state.to = [1, 1, 1]; change(); };
  $("close").onclick = () => answer(null);
  $("home").onclick = () => { home(); redraw(); };
  $("theme").onclick = () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  $("fold").textContent = "–";
  $("fold").onclick = () => {
    const folded = $("panel").classList.toggle("folded");
    $("fold").textContent = folded ? "+" : "–";
    $("fold").setAttribute("aria-expanded", String(!folded));
  };
  if (innerWidth <= 640) $("fold").click();
  $("backs-row").hidden = !map.oriented;
  $("backs").checked = state.cutBacks;
  $("backs").onchange = () => { state.cutBacks = $("backs").checked; redraw(); };
  makeLegend();
}

// ---- mouse, touch, keys --------------------------------------------------------------------------------------
function turn(dx, dy) {
  camera.turn += dx * 0.006;
  camera.tilt = Math.max(-1.55, Math.min(1.55, camera.tilt + dy * 0.006));
}

function move(dx, dy) {
  const a = axes(), step = 2 * tan * camera.distance / canvas.clientHeight;
  camera.target = add(add(camera.target, a.right, -dx * step), a.upward, dy * step);
}

function zoom(factor) {
  camera.distance = Math.max(1e-3 * breadth, Math.min(20 * breadth, camera.distance * factor));
}

function listen() {
  const fingers = new Map();
  let travelled = 0;
  canvas.oncontextmenu = event => event.preventDefault();
  canvas.onpointerdown = event => {
    if (!fingers.size) travelled = 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.setPointerCapture(event.pointerId);
  };
  canvas.onpointermove = event => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY], dx = now[0] - before[0], dy = now[1] - before[1];
    travelled += Math.hypot(dx, dy);
    if (fingers.size === 1) {
      event.shiftKey || event.buttons & 6 ? move(dx, dy) : turn(dx, dy);
    } else {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = p => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoom(apart(before) / apart(now));
      move(dx / 2, dy / 2);
    }
    fingers.set(event.pointerId, now);
    redraw();
  };
  canvas.onpointerup = event => {
    if (fingers.size === 1 && travelled < 5 && event.button === 0) answer(pick(event.clientX, event.clientY));
    fingers.delete(event.pointerId);
  };
  canvas.onpointercancel = event => fingers.delete(event.pointerId);
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    zoom(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 30 : 1)));
    redraw();
  }, { passive: false });
  canvas.ondblclick = event => {
    const i = pick(event.clientX, event.clientY);
    if (i === null) return;
    camera.target = add(place(map.levels[state.level], i), middle, -1);
    redraw();
  };
  const keys = { ArrowLeft: () => turn(-20, 0), ArrowRight: () => turn(20, 0), ArrowUp: () => turn(0, -20),
    ArrowDown: () => turn(0, 20), "+": () => zoom(0.87), "-": () => zoom(1.15), r: home, Escape: () => answer(null) };
  canvas.onkeydown = event => { if (keys[event.key]) { keys[event.key](); redraw(); } };
  addEventListener("resize", redraw);
  canvas.addEventListener("webglcontextlost", event => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => { drawnSize = ""; begin(); change(); });
}

async function main() {
  theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  if (!gl) throw new Error("this browser has no WebGL 2, which the page needs to draw the map");
  await Promise.all(map.levels.map(unpack));
  home();
  makeControls();
  begin();
  listen();
  change();
  $("message").hidden = true;
}

main().catch(error => { $("message").hidden = false; $("message").textContent = "The map cannot be shown: " + error.message; });
