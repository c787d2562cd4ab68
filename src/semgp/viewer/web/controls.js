// The panel.
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
    $("high").textContent = short(scale.high) + (units[state.field] || "");
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
  showLegend(level);
}

function showLegend(level) {  // the classes that occur, most points first; what is not observed last
  const rank = entry => Number(entry.dataset.label) === missing ? -1 : level.counts[Number(entry.dataset.label)];
  $("legend").append(...[...$("legend").children].sort((a, b) => rank(b) - rank(a)));
  for (const entry of $("legend").children) {
    const label = Number(entry.dataset.label), on = !state.off.has(label), count = level.counts[label];
    entry.hidden = !count;
    entry.firstChild.classList.toggle("off", !on);
    entry.querySelector("input").checked = on;
    entry.querySelector(".share").textContent = percent(count / level.points);
    entry.title = `${count.toLocaleString("en")} points`;
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
    label.append(box, swatch, name, element("span", "share"));
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
  $("backs-row").hidden = !map.seeInside;
  $("backs").checked = state.seeInside;
  $("backs").onchange = () => { state.seeInside = $("backs").checked; redraw(); };
  makeLegend();
}
