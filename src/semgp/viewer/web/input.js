// Mouse, touch and keys; then everything begins.
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
