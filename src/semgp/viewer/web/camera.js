// An eye that turns about a target.
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
