"use strict";
// The map in #data, what its levels hold, and the choices of who looks.

const $ = id => document.getElementById(id);
const map = JSON.parse($("data").textContent);
const missing = map.classes.length;
const named = [...map.classes, { name: "not observed", colour: map.missing }];
const state = { level: 0, field: map.state.field, off: new Set(map.state.hidden), size: 1, axis: map.up.findIndex(v => v),
  from: [0, 0, 0], to: [1, 1, 1], seeInside: map.seeInside, picked: null };

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const unit = a => scaled(a, 1 / (Math.hypot(...a) || 1));

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
