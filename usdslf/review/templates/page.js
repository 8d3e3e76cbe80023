"use strict";
// The page of a review.  Text from the shot is only ever set as textContent.
const data = JSON.parse(document.getElementById("data").textContent);
const pictures = JSON.parse(document.getElementById("pictures").textContent);
const $ = (id) => document.getElementById(id);
const MODES = ["before", "after", "wipe", "blink", "difference", "indirect"];
const BLINK = 600; // milliseconds
const FEW = 4; // explanations that are shown at once
const state = { view: 0, mode: "wipe", wipe: 0.5, gain: 2, strokes: true, outline: false, picked: -1, second: false };
const loaded = new Map(); // picture's name -> { image, pixels }

// ---- small things ---------------------------------------------------------------------------------
function shown(text) { // what could hide or turn other text is written out
  return String(text).replace(/[\p{Cc}\p{Cf}\u2028\u2029]/gu, (c) => "\\u" + c.codePointAt(0).toString(16).padStart(4, "0"));
}
function el(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name === "class") node.className = value;
    else if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value);
  }
  for (const child of children) node.append(child);
  return node;
}
const text = (value) => el("bdi", {}, shown(value));
const path = (value) => el("span", { class: "path" }, text(value));
function number(value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return value.toFixed(3);
  if (Array.isArray(value)) return value.map(number).join(" ");
  return shown(value);
}
function swatch(color) {
  const node = el("span", { class: "sw" });
  if (color) node.style.background = color;
  else node.style.visibility = "hidden";
  return node;
}
const valued = (value, color) => [color ? swatch(color) : "", el("span", { class: "num" }, number(value))];

// ---- verdicts -------------------------------------------------------------------------------------
const verdicts = new Map(); // target -> { verdict, note }
const KEY = "usdslf-review " + data.look_hash;
function keep() {
  try { localStorage.setItem(KEY, JSON.stringify([...verdicts])); } catch (error) { /* private windows keep nothing */ }
}
function recall() {
  try { for (const [target, said] of JSON.parse(localStorage.getItem(KEY) || "[]")) verdicts.set(target, said); }
  catch (error) { verdicts.clear(); }
}
function judge(target, change) {
  const said = { verdict: "", note: "", ...verdicts.get(target), ...change };
  if (said.verdict || said.note) verdicts.set(target, said);
  else verdicts.delete(target);
  keep();
  for (const node of document.querySelectorAll("[data-target]")) {
    const of = node.dataset.target;
    if (of !== target && !of.startsWith(target + ".")) continue;
    const own = (verdicts.get(of) || {}).verdict, material = (verdicts.get(of.split(".")[0]) || {}).verdict;
    for (const button of node.querySelectorAll("button")) {
      button.setAttribute("aria-pressed", String(button.dataset.verdict === own));
      button.classList.toggle("follows", !own && button.dataset.verdict === material); // an input its material's
    }
    const note = node.querySelector("input");
    if (of === target && note && note !== document.activeElement) note.value = said.note;
  }
}
function judging(target, hasNote) {
  if (data.is_diff) return "";
  const node = el("span", { class: "verdict", "data-target": target, onclick: (e) => e.stopPropagation() });
  const button = (name) => el("button", {
    class: name, "data-verdict": name, "aria-pressed": "false",
    onclick: () => judge(target, { verdict: (verdicts.get(target) || {}).verdict === name ? "" : name }),
  }, name[0].toUpperCase() + name.slice(1));
  node.append(el("span", { class: "group" }, button("accept"), button("reject")));
  if (hasNote) {
    node.append(el("input", { type: "text", placeholder: "note", "aria-label": "note",
      oninput: (e) => judge(target, { note: e.target.value }) }));
  }
  return node;
}
function verdictFile() {
  const list = [...verdicts].map(([target, said]) => ({
    target, verdict: said.verdict || "accept", note: said.note,
  }));
  return { look: data.look_name, lookHash: data.look_hash, by: $("by").value, verdicts: list };
}
function save() {
  const blob = new Blob([JSON.stringify(verdictFile(), null, 2) + "\n"], { type: "application/json" });
  const link = el("a", { href: URL.createObjectURL(blob), download: data.verdict_name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  const count = verdicts.size === 0 ? "all is accepted" : verdicts.size === 1 ? "1 verdict" : verdicts.size + " verdicts";
  $("saved").replaceChildren("saved: " + count);
  $("saved").title = "carry it out with: usdslf accept SHOT LOOK -o ACCEPTED --verdict " + data.verdict_name;
}

// ---- pictures -------------------------------------------------------------------------------------
async function load(name) {
  if (!loaded.has(name)) {
    const image = new Image();
    image.src = pictures[name];
    const entry = { image, pixels: null, ready: image.decode() };
    loaded.set(name, entry);
  }
  const entry = loaded.get(name);
  await entry.ready;
  if (!entry.pixels) {
    const canvas = el("canvas", { width: entry.image.naturalWidth, height: entry.image.naturalHeight });
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(entry.image, 0, 0);
    entry.pixels = context.getImageData(0, 0, canvas.width, canvas.height);
  }
  return entry;
}
const view = () => data.views[state.view];
function heat(x) { // black body: dark red, orange, white
  const clamp = (v) => Math.round(255 * Math.min(1, Math.max(0, v)));
  return [clamp(x * 2.2), clamp(x * 2.2 - 0.7), clamp(x * 2.6 - 1.7)];
}
function differenceOf(before, after, gain) {
  const out = new ImageData(before.width, before.height);
  for (let i = 0; i < out.data.length; i += 4) {
    for (let c = 0; c < 3; c++) out.data[i + c] = gain * Math.abs(after.data[i + c] - before.data[i + c]);
    out.data[i + 3] = 255;
  }
  return out;
}
function indirectOf(map, under, gain) {
  const out = new ImageData(map.width, map.height);
  for (let i = 0; i < out.data.length; i += 4) {
    const grey = 0.22 * (0.3 * under.data[i] + 0.6 * under.data[i + 1] + 0.1 * under.data[i + 2]);
    const color = heat(map.data[i] / 255 * gain / 4);
    for (let c = 0; c < 3; c++) out.data[i + c] = Math.max(grey, color[c]);
    out.data[i + 3] = 255;
  }
  return out;
}
let drawn = 0;
async function draw() {
  const mine = ++drawn, v = view();
  const [before, after, parts, indirect] = await Promise.all(
    [v.before, v.after, v.parts, v.indirect_map].map(load));
  if (mine !== drawn) return;
  const canvas = $("canvas"), context = canvas.getContext("2d"), gain = 2 ** state.gain;
  const [width, height] = v.size;
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const mode = state.mode;
  if (mode === "difference") context.putImageData(differenceOf(before.pixels, after.pixels, gain), 0, 0);
  else if (mode === "indirect") context.putImageData(indirectOf(indirect.pixels, before.pixels, gain), 0, 0);
  else if (mode === "wipe") {
    const edge = Math.round(state.wipe * width);
    context.drawImage(before.image, 0, 0);
    if (edge < width) context.drawImage(after.image, edge, 0, width - edge, height, edge, 0, width - edge, height);
    context.fillStyle = "#fff";
    context.fillRect(edge - 0.5, 0, 1, height);
  } else context.drawImage((mode === "before" || (mode === "blink" && !state.second) ? before : after).image, 0, 0);
  const row = state.picked < 0 ? null : new Set(data.materials[state.picked].rows);
  if (state.outline || row) outline(context, parts.pixels, row);
  if (state.strokes) drawStrokes(context, v);
  tell(v);
}
const partAt = (pixels, i) => pixels.data[i] + 256 * pixels.data[i + 1] - 1;
function outline(context, pixels, rows) {
  const { width, height } = pixels;
  const is = (x, y) => {
    if (x < 0 || y < 0 || x >= width || y >= height) return false;
    const part = partAt(pixels, 4 * (y * width + x));
    return part >= 0 && (!rows || rows.has(part));
  };
  context.fillStyle = "rgba(255, 255, 255, .85)";
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      if (is(x, y) && !(is(x - 1, y) && is(x + 1, y) && is(x, y - 1) && is(x, y + 1))) context.fillRect(x, y, 1, 1);
    }
  }
}
function drawStrokes(context, v) {
  const [width, height] = v.size;
  const picked = state.picked < 0 ? null : new Set(data.materials[state.picked].strokes);
  for (const stroke of v.strokes) {
    if (picked && !picked.has(stroke.path)) continue;
    for (const [x, y, r] of stroke.dabs) {
      context.beginPath();
      context.arc(x * width, y * height, Math.max(1.5, r * width), 0, 2 * Math.PI);
      for (const [line, color] of [[3.4, "rgba(0, 0, 0, .5)"], [2.4, "rgba(255, 255, 255, .8)"], [1.2, stroke.target_color || "#fff"]]) {
        context.lineWidth = line; // seen on dark and on bright
        context.strokeStyle = color;
        context.stroke();
      }
    }
  }
}
function tell(v) {
  const [first, second] = data.ends.map(shown);
  const names = {
    before: [first, ""], after: [second, ""], wipe: [first, second], blink: [state.second ? second : first, ""], difference: ["difference of display values", ""],
    indirect: ["changes without being edited", ""],
  };
  const [left, right] = names[state.mode];
  $("tag-left").textContent = left;
  $("tag-left").hidden = !left;
  $("tag-right").textContent = right;
  $("tag-right").hidden = !right;
  for (const button of $("modes").children) button.setAttribute("aria-pressed", String(button.dataset.mode === state.mode));
  $("gain-label").hidden = state.mode !== "difference" && state.mode !== "indirect";
  $("gain-value").textContent = "× " + 2 ** state.gain;
  const legend = $("legend");
  legend.replaceChildren();
  legend.hidden = state.mode !== "indirect";
  if (state.mode === "indirect") {
    const bar = el("canvas", { width: 120, height: 1 }), context = bar.getContext("2d");
    for (let x = 0; x < 120; x++) { context.fillStyle = `rgb(${heat(x / 119).join(",")})`; context.fillRect(x, 0, 1, 1); }
    legend.append("0", bar, (v.indirect_scale * 4 / 2 ** state.gain).toPrecision(2) + " radiance");
  }
  $("strokes").setAttribute("aria-pressed", String(state.strokes));
  $("outline").setAttribute("aria-pressed", String(state.outline));
}
function pixelAt(event) {
  const box = $("canvas").getBoundingClientRect();
  const x = (event.clientX - box.left) / box.width, y = (event.clientY - box.top) / box.height;
  return [Math.min(0.999999, Math.max(0, x)), Math.min(0.999999, Math.max(0, y))];
}
async function read(event) {
  const v = view(), [x, y] = pixelAt(event), [width, height] = v.size;
  const [before, after, parts] = await Promise.all([v.before, v.after, v.parts].map(load));
  const px = Math.floor(x * width), py = Math.floor(y * height), i = 4 * (py * width + px);
  const rgb = (p) => [0, 1, 2].map((c) => String(p.data[i + c]).padStart(3, " ")).join(" ");
  const color = (p) => `rgb(${p.data[i]}, ${p.data[i + 1]}, ${p.data[i + 2]})`;
  const part = partAt(parts.pixels, i);
  const gprim = part >= 0 ? data.gprims[part] : null;
  $("readout").replaceChildren(
    el("span", { class: "dim" }, `${px}, ${py}`),
    el("span", {}, text(data.ends[0]), " ", swatch(color(before.pixels)), " ", el("span", { class: "num" }, rgb(before.pixels))),
    el("span", {}, text(data.ends[1]), " ", swatch(color(after.pixels)), " ", el("span", { class: "num" }, rgb(after.pixels))),
    gprim ? path(gprim.path) : el("span", { class: "dim" }, "not edited"),
  );
  return part;
}
function pick(index) {
  state.picked = state.picked === index ? -1 : index;
  for (const card of document.querySelectorAll(".card")) card.classList.toggle("is-picked", Number(card.dataset.index) === state.picked);
  const card = document.querySelector(".card.is-picked");
  if (card) card.scrollIntoView({ block: "nearest" });
  draw();
}
let timer = 0;
function setMode(mode) {
  state.mode = mode;
  clearInterval(timer);
  if (mode === "blink") timer = setInterval(() => { state.second = !state.second; draw(); }, BLINK);
  draw();
}
function setView(index) {
  state.view = index;
  const turning = view().kind === "turntable";
  $("turn-label").hidden = !turning;
  for (const button of $("strip").children) {
    const on = Number(button.dataset.view) === index || (turning && button.dataset.kind === "turntable");
    button.setAttribute("aria-pressed", String(on));
  }
  draw();
}

// ---- tables ---------------------------------------------------------------------------------------
function from(material) { // the strokes that caused a change
  const strokes = material ? material.strokes : [], node = el("div", { class: "dim" });
  node.append(strokes.length ? "from " : "from no stroke");
  strokes.slice(0, 6).forEach((s, i) => node.append(i ? ", " : "", path(s.split("/").pop())));
  if (strokes.length > 6) node.append(` and ${strokes.length - 6} more`);
  return node;
}
const PARAMETERS = ["diffuse", "specular", "roughness"];
function cards() {
  data.materials.forEach((m, index) => {
    const dl = el("dl");
    for (const name of PARAMETERS) {
      if (m.before[name] === undefined || number(m.before[name]) === number(m.after[name])) continue;
      dl.append(el("dt", {}, name), el("dd", {}, ...valued(m.before[name], (m.colors.before || {})[name])),
        el("dd", { class: "dim" }, "→"), el("dd", {}, ...valued(m.after[name], (m.colors.after || {})[name])), el("span"));
    }
    const residual = m.residual_after === undefined ? "" :
      el("div", { class: "dim" }, "residual ", el("span", { class: "num" }, `${number(m.residual_before)} → ${number(m.residual_after)}`));
    $("cards").append(el("div", { class: "card", "data-index": index, onclick: () => pick(index) },
      el("div", { class: "name" }, text(m.shown_at.split("/").pop()), el("span", { class: "dim" }, "  " + m.inferred)),
      el("div", { class: "dim path" }, text(m.shown_at)), dl, from(m), residual, judging(m.shown_at, true)));
  });
  if (!data.materials.length) $("cards").append(el("div", { class: "card dim" }, "The look changes nothing."));
}
const MEANS = { diffuseColor: "diffuse", specularColor: "specular", roughness: "roughness" }; // of an input, in a material
function meanOf(material, row, end) { // where a number does not say what is seen
  const name = MEANS[row.name.split(":")[0]];
  if (row.representation === "constant" || !material || !name || material[end][name] === undefined) return "";
  return el("div", { class: "dim" }, "mean ", ...valued(material[end][name], (material.colors[end] || {})[name]));
}
function changes() {
  const body = $("changes").tBodies[0];
  for (const group of data.changes) {
    const material = data.materials.find((m) => m.shown_at === group.material);
    body.append(el("tr", { class: "of" }, el("td", { colspan: 5, class: "path" }, text(group.material), from(material)),
      el("td", {}, judging(group.material, false))));
    for (const row of group.inputs) {
      const shows = row.off ? "off" : row.wins ? "yes" : "hidden by " + row.hidden_by;
      body.append(el("tr", { class: row.off ? "is-off" : "" },
        el("td", { class: "path" }, text(row.name)),
        el("td", {}, ...valued(row.before, row.before_color), meanOf(material, row, "before")),
        el("td", {}, ...valued(row.after, row.after_color), meanOf(material, row, "after")),
        el("td", {}, row.representation, row.more ? el("span", { class: "dim" }, ` + ${row.more} more opinion${row.more === 1 ? "" : "s"}`) : ""),
        el("td", { class: row.wins ? "" : "bad" }, text(shows),
          row.drifted ? el("div", { class: "warn" }, text(row.drifted)) : ""),
        el("td", {}, row.target ? judging(row.target, false) : "")));
    }
  }
}
function strokes() {
  const body = $("stroke-table").tBodies[0], seen = new Map();
  for (const v of data.views) for (const s of v.strokes) {
    if (v.kind === "stroke" && v.painted_from.includes(s.path) && !seen.has(s.path)) seen.set(s.path, s);
  }
  for (const stroke of data.strokes) {
    const s = seen.get(stroke.path) || {};
    const of = data.materials.find((m) => m.strokes.includes(stroke.path)) || {};
    const changed = el("td");
    stroke.materials.forEach((m, i) => changed.append(i ? ", " : "", path(m.split("/").pop())));
    const others = (of.strokes || []).filter((s) => s !== stroke.path).map((s) => s.split("/").pop());
    if (others.length) changed.append(el("div", { class: "dim", title: "rejected alone, the others are solved again without it" },
      "together with ", text(others.slice(0, 3).join(", ") + (others.length > 3 ? ` and ${others.length - 3} more` : ""))));
    const color = (value, hex) => el("td", { class: "nw" }, ...(value && value.length ? valued(value, hex) : ["–"]));
    body.append(el("tr", {}, el("td", { class: "path" }, text(stroke.path)),
      el("td", { class: "nw" }, stroke.tool, stroke.mode === "indirect" ? ", indirect" : ""), changed,
      color(s.target, s.target_color), color(s.seen_before, s.before_color), color(s.seen_after, s.after_color),
      el("td", { class: "r num" }, number(of.residual_before)), el("td", { class: "r num" }, number(of.residual_after)),
      el("td", {}, judging(stroke.path, false))));
  }
  for (const gone of data.strokes_gone) {
    body.append(el("tr", {}, el("td", { class: "path" }, text(gone)), el("td", { colspan: 7, class: "warn" },
      "not in the stroke layer any more"), el("td", {}, judging(gone, false))));
  }
}
function alternatives() {
  const body = $("alternatives").tBodies[0];
  for (const m of data.materials) {
    if (!m.alternatives.length) continue;
    body.append(el("tr", { class: "of" }, el("td", { colspan: 6, class: "path" }, text(m.shown_at))));
    const order = m.alternatives.map((a, i) => i).sort((i, j) => (m.alternatives[i].cost ?? 1e9) - (m.alternatives[j].cost ?? 1e9));
    const chosen = m.alternatives.findIndex((a) => a.id === m.inferred || a.id.startsWith(m.inferred + " of ")); // indirect
    order.forEach((i, rank) => {
      const a = m.alternatives[i], colors = (m.alternative_colors || [])[i] || {};
      body.append(el("tr", rank < FEW ? {} : { hidden: "" }, el("td", { class: "nw" }, text(a.id), i === chosen ? el("span", { class: "good" }, "  chosen") : ""),
        el("td", { class: "r num" }, a.cost === null ? "not admitted" : a.cost.toFixed(1)),
        el("td", { class: "r num" }, a.probability.toFixed(2)),
        el("td", { class: "nw" }, ...valued(a.after.diffuse, colors.diffuse)),
        el("td", { class: "nw" }, ...valued(a.after.specular, colors.specular)),
        el("td", { class: "r num" }, number(a.after.roughness))));
    });
    if (order.length > FEW) {
      const mine = [...body.children].slice(-(order.length - FEW));
      const more = el("tr", {}, el("td", { colspan: 6 }, el("button", { onclick: () => {
        for (const row of mine) row.hidden = false;
        more.remove();
      } }, `${order.length - FEW} more`)));
      body.append(more);
    }
  }
  if (!body.children.length) body.append(el("tr", {}, el("td", { colspan: 6, class: "dim" }, "The look says none.")));
}
function gprims() {
  const body = $("gprims").tBodies[0];
  const sorted = [...data.gprims].sort((a, b) => a.painted - b.painted);
  for (const g of sorted) {
    const shows = el("td");
    g.materials.forEach((m, i) => shows.append(i ? ", " : "", path(m.split("/").pop())));
    body.append(el("tr", {}, el("td", { class: "path" }, text(g.path), g.instance ? el("div", { class: "dim" }, "in the instance ", text(g.instance)) : ""),
      shows, el("td", { class: g.painted ? "" : "warn" }, g.painted ? "yes" : "no")));
  }
  if (!sorted.length) body.append(el("tr", {}, el("td", { colspan: 3, class: "dim" }, "Nothing.")));
}
async function strip() {
  const turns = data.views.map((v, i) => [v, i]).filter(([v]) => v.kind === "turntable").map(([, i]) => i);
  data.views.forEach((v, index) => {
    if (v.kind === "turntable" && index !== turns[0]) return;
    const canvas = el("canvas", { width: 276, height: Math.round(276 * v.size[1] / v.size[0]) });
    const name = { stroke: "painted from", "held out": "held out", light: "other light", camera: "camera", turntable: "turntable" }[v.kind];
    $("strip").append(el("button", { "data-view": index, "data-kind": v.kind, "aria-pressed": "false", title: shown(v.light || v.name),
      onclick: () => setView(index) }, canvas, el("small", {}, name + ": ", text(v.light || v.name.split("/").pop()))));
    load(v.after).then((entry) => canvas.getContext("2d").drawImage(entry.image, 0, 0, canvas.width, canvas.height));
  });
  $("turn").max = Math.max(0, turns.length - 1);
  $("turn").addEventListener("input", (e) => setView(turns[Number(e.target.value)]));
}

// ---- what a hand does -----------------------------------------------------------------------------
$("modes").addEventListener("click", (e) => { if (e.target.dataset.mode) setMode(e.target.dataset.mode); });
$("gain").addEventListener("input", (e) => { state.gain = Number(e.target.value); draw(); });
$("strokes").addEventListener("click", () => { state.strokes = !state.strokes; draw(); });
$("outline").addEventListener("click", () => { state.outline = !state.outline; draw(); });
if (!data.is_diff) $("save").addEventListener("click", save);
const screen_ = $("screen");
let dragged = false;
screen_.addEventListener("pointerdown", (e) => {
  screen_.setPointerCapture(e.pointerId);
  dragged = false;
  if (state.mode === "wipe" && Math.abs(pixelAt(e)[0] - state.wipe) < 0.05) dragged = true;
});
screen_.addEventListener("pointermove", (e) => {
  if (e.buttons && state.mode === "wipe") { dragged = true; state.wipe = pixelAt(e)[0]; draw(); }
  read(e);
});
screen_.addEventListener("pointerup", async (e) => {
  if (dragged) return;
  const part = await read(e);
  const index = data.materials.findIndex((m) => m.rows.includes(part));
  if (index >= 0) pick(index); else if (state.picked >= 0) pick(state.picked);
});
document.addEventListener("keydown", (e) => {
  if (e.target.tagName === "INPUT" || e.ctrlKey || e.metaKey || e.altKey) return;
  const mode = MODES[Number(e.key) - 1];
  if (mode) setMode(mode);
  else if (e.key === "s") $("strokes").click();
  else if (e.key === "o") $("outline").click();
  else if (e.key === "ArrowRight" || e.key === "ArrowLeft") {
    setView((state.view + (e.key === "ArrowRight" ? 1 : data.views.length - 1)) % data.views.length);
  } else return;
  e.preventDefault();
});
cards();
changes();
gprims();
if (!data.is_diff) { recall(); strokes(); alternatives(); }
strip();
for (const target of verdicts.keys()) judge(target, {});
setView(0);
