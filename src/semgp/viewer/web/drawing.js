// Drawing: coarse at once, and finer when nothing has moved for a while.
const canvas = $("view");
const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });

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
    attribute(4, 1, level.oneSided, false);
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
  gl.uniform1i(points.at.seeInside, state.seeInside ? 1 : 0);
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
  fine = setTimeout(refine, 160);
}

function refine() {
  if (pending) { fine = setTimeout(refine, 40); return; }  // a slow computer has not drawn it coarsely yet
  draw(2);
  delete canvas.dataset.busy;
  canvas.dataset.drawn = String(1 + Number(canvas.dataset.drawn || 0));
}
