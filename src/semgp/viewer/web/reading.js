// Reading a point: which one a click meets, and what the map says there.
function place(level, i) {
  return [0, 1, 2].map(k => level.low[k] + level.position[3 * i + k] / 65535 * level.extent[k]);
}

function onScreen(x, a) {
  const d = add(x, a.eye, -1), z = dot(d, a.forward), h = canvas.clientHeight, f = h / (2 * tan);
  return [canvas.clientWidth / 2 + free().aside + f * dot(d, a.right) / z, h / 2 - f * dot(d, a.upward) / z, z];
}

function backwards(level, i, sight) {  // of a wall that turns its back
  const n = level.normal.subarray(3 * i, 3 * i + 3);
  return level.oneSided[i] && dot(n, sight) > 0.02 * 127 * Math.hypot(...sight);
}

function pick(x, y) {
  const level = map.levels[state.level], a = axes(), [from, to] = cut(), f = canvas.clientHeight / (2 * tan);
  let best = null, bestScore = Infinity;
  for (let i = 0; i < level.points; i++) {
    if (state.off.has(level.label[i])) continue;
    const p = add(place(level, i), middle, -1);
    if (p.some((v, k) => v < from[k] || v > to[k])) continue;
    const [u, v, z] = onScreen(p, a);
    if (z <= 0 || state.seeInside && backwards(level, i, add(p, a.eye, -1))) continue;
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

const percent = p => p > 0 && p < 0.0005 ? "< 0.1 %" : (100 * p).toFixed(p >= 0.0995 ? 0 : 1) + " %";
const units = { entropy: " nats" };
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
    if (p || !j) rows.push([map.classes[level.top[i * k + j]], p / 255]);
  }
  const others = missing - rows.length;
  if (others) rows.push([{ name: others > 1 ? `${others} others` : "1 other", colour: map.missing }, Math.max(0, rest) / 255]);
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
    .map(([name, [low, high]]) => `${name} ${short(low + level[name][i] / 255 * (high - low))}${units[name] || ""}`).join(" · ");
}

function placeMark(a) {
  if (state.picked === null) return;
  const [u, v, z] = onScreen(add(place(map.levels[state.level], state.picked), middle, -1), a);
  $("mark").style.cssText = `left: ${u}px; top: ${v}px; visibility: ${z > 0 ? "visible" : "hidden"}`;
}
