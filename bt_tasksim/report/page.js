"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const TIME = DATA.time, LAST = TIME[TIME.length - 1] || 1e-3;
const SVG = "http://www.w3.org/2000/svg";
const byId = (id) => document.getElementById(id);

function make(tag, attributes = {}, parent = null, text = null) {
  const inSvg = parent instanceof SVGElement || tag === "svg";
  const element = inSvg ? document.createElementNS(SVG, tag) : document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== null) element.textContent = text;
  if (parent) parent.append(element);
  return element;
}

/* ---- the header ---- */

function header() {
  const a = DATA.about;
  byId("title").textContent = a.scenario;
  const outcome = byId("outcome");
  outcome.className = a.success ? "good" : "bad";
  make("b", {}, outcome, a.success ? "success" : "failure");
  const why = a.why || (a.success ? "the tree ended with SUCCESS" : a.reason);
  outcome.append(why);
  const names = [...new Set(Object.values(a.policies))];
  const policies = names.length === 1
    ? `all ${names[0]}`
    : Object.entries(a.policies).map(([leaf, policy]) => `${leaf}: ${policy}`).join(", ");
  const facts = {
    seed: a.seed, robot: a.robot, engines: a.engines, perception: a.perception, policies: policies || "none",
    tree: a.status, "simulated time": `${a.sim_time.toFixed(2)} s in ${a.control_steps} steps`,
    "computed in": `${a.wall_time.toFixed(1)} s`,
  };
  if (a.judged === false && a.success) facts.judged = "no: the tree's own word was taken";
  for (const p of (a.verdict && a.verdict.placements) || []) facts[p.goal] = p.why;
  for (const [key, value] of Object.entries(facts)) fact(byId("facts"), key, value);
  const numbers = { stream: a.stream, "control frequency": `${a.control_frequency} Hz` };
  if (a.verdict) {
    const v = a.verdict;
    if (v.position_error !== null) numbers["position error"] = `${(1000 * v.position_error).toFixed(1)} mm`;
    if (v.angle_error !== null) numbers["angle error"] = `${(180 / Math.PI * v.angle_error).toFixed(2)} degrees`;
    numbers["deepest penetration"] = `${(1000 * v.penetration).toFixed(2)} mm`;
  }
  if (a.timing) numbers["control rate"] = a.timing.summary;
  numbers["object curves show"] = DATA.objectsAre;
  for (const [key, value] of Object.entries({ ...numbers, ...a.versions })) {
    make("dt", {}, byId("numbers"), key);
    make("dd", {}, byId("numbers"), value);
  }
}

function fact(list, key, value) {
  const row = make("div", {}, list);
  make("dt", {}, row, key);
  make("dd", {}, row, String(value));
}

/* ---- statuses ---- */

function tickAt(time) {
  let low = 0, high = TIME.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (TIME[middle] <= time + 1e-6) low = middle; else high = middle - 1;
  }
  return low;
}

function statusAt(node, tick) {
  for (const [from, to, status] of DATA.spans[node]) if (from <= tick && tick < to) return status;
  return "";
}

const until = (tick) => TIME[Math.min(tick, TIME.length - 1)];
const isLeaf = DATA.nodes.map((node) => !DATA.nodes.some((other) => other.parent === node.id));
const depths = [];
for (const node of DATA.nodes) depths.push(node.parent < 0 ? 0 : depths[node.parent] + 1);
const concepts = DATA.nodes.filter((node) => node.concept);
const active = concepts.flatMap((node) =>
  DATA.spans[node.id].filter((s) => s[2] === "RUNNING").map(([a, b]) => [TIME[a], until(b), node])
).sort((a, b) => a[0] - b[0]);

/* ---- plots share one time axis and one cursor ---- */

const plots = [];

function plot(parent, height, draw, margins) {
  const svg = make("svg", { class: "plot", height }, null);
  parent.append(svg);
  const it = { svg, height, draw, ...margins, x: null };
  const seek = (event) => {
    const box = svg.getBoundingClientRect();
    const share = (event.clientX - box.left - it.left) / (it.width - it.left - it.right);
    setTime(Math.min(Math.max(share, 0), 1) * LAST);
  };
  svg.addEventListener("pointerdown", (event) => { svg.setPointerCapture(event.pointerId); pause(); seek(event); });
  svg.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
  plots.push(it);
  return it;
}

function redraw() {
  for (const it of plots) {
    it.width = Math.max(it.svg.parentElement.clientWidth - (it.padding || 0), 160);
    it.svg.setAttribute("viewBox", `0 0 ${it.width} ${it.height}`);
    it.svg.replaceChildren();
    it.x = (time) => it.left + (time / LAST) * (it.width - it.left - it.right);
    it.draw(it);
    it.cursor = make("line", { class: "cursor", y1: it.top, y2: it.height - it.bottom }, it.svg);
  }
  showTime();
}

function niceStep(span, count) {
  const raw = span / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(raw));
  for (const factor of [1, 2, 5, 10]) if (factor * power >= raw * 0.999) return factor * power;
  return 10 * power;
}

function number(value, step) {
  const text = value.toFixed(Math.min(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), 6));
  return /^-[0.]*$/.test(text) ? text.slice(1) : text;
}

function timeAxis(it) {
  const step = niceStep(LAST, (it.width - it.left - it.right) / 70), base = it.height - it.bottom;
  for (let t = 0; t <= LAST + 1e-9; t += step) {
    const x = it.x(t);
    make("line", { class: "grid", x1: x, x2: x, y1: it.top, y2: base }, it.svg);
    const anchor = x > it.width - 24 ? "end" : "middle";
    const unit = t === 0 ? " s" : "";
    make("text", { x: Math.min(x, it.width - 1), y: base + 15, "text-anchor": anchor }, it.svg, number(t, step) + unit);
  }
  if (DATA.end < LAST - 1e-9) {
    const rest = make("rect", { class: "rest", x: it.x(DATA.end), y: it.top, width: it.x(LAST) - it.x(DATA.end), height: base - it.top }, it.svg);
    make("title", {}, rest, "the tree has ended; things come to rest");
  }
}

/* ---- the timeline ---- */

const ROW = 24;

function timeline() {
  const home = byId("timeline");
  const names = make("div", { class: "names" }, home), lanes = make("div", {}, home);
  const dots = DATA.nodes.map((node, i) => {
    const row = make("div", { title: `${node.type}: ${node.name}`, style: `padding-left:${10 + 14 * Math.min(depths[i], 8)}px` }, names);
    const dot = make("i", {}, row);
    make("span", {}, row, node.name);
    if (!isLeaf[i]) make("small", {}, row, node.type === node.name ? "" : node.type);
    return dot;
  });
  plot(lanes, ROW * DATA.nodes.length + 24, drawLanes, { left: 6, right: 14, top: 0, bottom: 24 });
  return dots;
}

function drawLanes(it) {
  timeAxis(it);
  DATA.nodes.forEach((node, i) => {
    const y = i * ROW;
    make("line", { class: "row", x1: it.left, x2: it.width - it.right, y1: y + ROW, y2: y + ROW }, it.svg);
    for (const [from, to, status] of DATA.spans[i]) {
      const x1 = it.x(TIME[from]), x2 = Math.max(it.x(until(to)), x1 + 2);
      const running = status === "RUNNING", thick = running ? 12 : 3;
      const kind = running ? (isLeaf[i] ? "" : "outer") : "after";
      const bar = make("rect", { class: `${status} ${kind}`, x: x1, y: y + (ROW - thick) / 2, width: x2 - x1, height: thick, rx: running ? 2 : 1 }, it.svg);
      make("title", {}, bar, `${node.name}: ${status.toLowerCase()}, ${TIME[from].toFixed(2)} to ${until(to).toFixed(2)} s`);
      if (!running) make("rect", { class: status, x: x1 - 1.5, y: y + 4, width: 3, height: ROW - 8, rx: 1 }, it.svg);
    }
  });
  for (const [time, node, text] of DATA.messages) {
    const dot = make("circle", { class: "message", cx: it.x(time), cy: node * ROW + ROW / 2, r: 4 }, it.svg);
    make("title", {}, dot, `${time.toFixed(2)} s, ${DATA.nodes[node].name}: ${text}`);
  }
}

/* ---- curves ---- */

function colour(panel, i) {
  if (panel.curves.length <= 8) return `var(--c${i})`;
  return `hsl(${Math.round(360 * i / panel.curves.length)} 62% 52%)`;
}

function panels() {
  return DATA.panels.map((panel) => {
    const card = make("div", { class: "panel" }, byId("panels"));
    const title = make("h3", {}, card, panel.title);
    if (panel.unit) make("span", {}, title, ` in ${panel.unit}`);
    const legend = make("div", { class: "legend" }, card);
    const values = panel.curves.map((curve, i) => {
      const item = make("div", {}, legend);
      const line = make("svg", { viewBox: "0 0 18 8" }, null);
      item.append(line);
      make("line", { x1: 0, x2: 18, y1: 4, y2: 4, style: `stroke:${colour(panel, i)};stroke-width:3`, ...(curve.dashed ? { "stroke-dasharray": "5 3" } : {}) }, line);
      make("span", {}, item, curve.name);
      return make("output", {}, item);
    });
    const all = panel.curves.flatMap((curve) => curve.values).filter((v) => v !== null);
    let low = Math.min(...all), high = Math.max(...all);
    const flat = high - low < 0.2 * Math.max(Math.abs(low), Math.abs(high));
    if (low > 0 && (flat || low < 0.5 * high)) low = 0;
    if (high < 0 && (flat || high > 0.5 * low)) high = 0;
    const least = 1e-3 * Math.max(Math.abs(low), Math.abs(high), 1);
    if (high - low < least) { const middle = (low + high) / 2; low = middle - least; high = middle + least; }
    const step = niceStep(high - low, 4);
    low = Math.floor(low / step + 1e-9) * step;
    high = Math.ceil(high / step - 1e-9) * step;
    const widest = Math.max(number(low, step).length, number(high, step).length);
    plot(card, 168, (it) => drawCurves(it, panel, low, high, step), { left: 12 + 7 * widest, right: 8, top: 6, bottom: 22, padding: 26 });
    return { panel, values, step };
  });
}

function drawCurves(it, panel, low, high, step) {
  const base = it.height - it.bottom, y = (v) => base - (v - low) / (high - low) * (base - it.top);
  active.forEach(([from, to, node], i) => {
    if (i % 2) return;
    const band = make("rect", { class: "band", x: it.x(from), y: it.top, width: Math.max(it.x(to) - it.x(from), 0), height: base - it.top }, it.svg);
    make("title", {}, band, node.name);
  });
  timeAxis(it);
  for (let v = low; v <= high + step / 2; v += step) {
    make("line", { class: Math.abs(v) < step / 1e3 ? "axis" : "grid", x1: it.left, x2: it.width - it.right, y1: y(v), y2: y(v) }, it.svg);
    make("text", { x: it.left - 6, y: y(v) + 4, "text-anchor": "end" }, it.svg, number(Math.abs(v) < step / 1e3 ? 0 : v, step));
  }
  panel.curves.forEach((curve, i) => {
    let path = "", pen = false;
    curve.values.forEach((v, k) => {
      if (v === null) { pen = false; return; }
      const alone = !pen && (k + 1 >= curve.values.length || curve.values[k + 1] === null);
      path += `${pen ? "L" : "M"}${it.x(TIME[k]).toFixed(1)} ${y(v).toFixed(1)}${alone ? "h1.5" : ""}`;
      pen = true;
    });
    make("path", { d: path, style: `stroke:${colour(panel, i)}`, ...(curve.dashed ? { "stroke-dasharray": "5 3" } : {}) }, it.svg);
  });
}

/* ---- messages ---- */

function messages() {
  const list = byId("messages");
  if (!DATA.messages.length) make("li", {}, list, "nothing");
  return DATA.messages.map(([time, node, text]) => {
    const item = make("li", {}, list);
    make("time", {}, item, `${time.toFixed(2)} s`);
    make("b", {}, item, DATA.nodes[node].name);
    make("span", {}, item, text);
    item.addEventListener("click", () => { pause(); setTime(time); });
    return item;
  });
}

/* ---- the film, or a clock of our own ---- */

let now = 0, playing = false, before = 0;
const film = openFilm();

function openFilm() {
  const text = byId("video").textContent.trim(), home = byId("film");
  if (!text) { make("p", {}, home, DATA.noVideo); return null; }
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const video = make("video", { preload: "auto", playsinline: "" }, home);
  video.muted = true;
  video.src = URL.createObjectURL(new Blob([bytes], { type: "video/mp4" }));
  video.addEventListener("click", toggle);
  video.addEventListener("loadedmetadata", () => { video.currentTime = filmTime(now); });
  video.addEventListener("error", () => {
    const why = make("p", {}, null, "This browser cannot show the video: it plays H.264 in MP4.");
    video.replaceWith(why);
  });
  return video;
}

function filmTime(time) { return Math.max(0, Math.min(time + 2e-3, (film.duration || 1e9) - 2e-3)); }

function setTime(time, moveFilm = true) {
  now = Math.min(Math.max(time, 0), LAST);
  if (moveFilm && film && film.readyState) film.currentTime = filmTime(now);
  showTime();
}

function showTime() {
  const tick = tickAt(now);
  for (const it of plots) {
    const x = it.x(now);
    it.cursor.setAttribute("x1", x);
    it.cursor.setAttribute("x2", x);
  }
  DATA.nodes.forEach((node, i) => {
    const status = statusAt(i, tick);
    dots[i].className = status;
    const drawn = byId(`node-${i}`);
    if (drawn) drawn.setAttribute("data-status", status || "INVALID");
  });
  for (const { panel, values, step } of curves) {
    panel.curves.forEach((curve, i) => {
      const v = curve.values[tick];
      values[i].textContent = v === null ? "–" : number(v, step / 100);
    });
  }
  let latest = -1;
  said.forEach((item, i) => {
    const later = DATA.messages[i][0] > now + 1e-6;
    item.classList.toggle("later", later);
    if (!later) latest = i;
  });
  said.forEach((item, i) => item.classList.toggle("now", i === latest));
  if (playing && latest >= 0) said[latest].scrollIntoView({ block: "nearest" });
  byId("slider").value = now;
  byId("clock").textContent = `${now.toFixed(2)} / ${LAST.toFixed(2)} s`;
}

function toggle() { if (playing) pause(); else play(); }

function play() {
  if (now >= LAST - 1e-3) setTime(0);
  playing = true;
  before = performance.now();
  if (film) { film.playbackRate = Number(byId("speed").value); film.play().catch(() => {}); }
  showButton();
  requestAnimationFrame(advance);
}

function pause() {
  playing = false;
  if (film) film.pause();
  showButton();
}

function advance(stamp) {
  if (!playing) return;
  if (film && film.isConnected) setTime(film.currentTime, false);
  else setTime(now + (stamp - before) / 1000 * Number(byId("speed").value), false);
  before = stamp;
  if (now >= LAST - 1e-3 || (film && film.ended)) { pause(); setTime(LAST); return; }
  requestAnimationFrame(advance);
}

function showButton() {
  byId("play").innerHTML = playing
    ? '<svg viewBox="0 0 14 14"><path d="M2 1h4v12H2zM8 1h4v12H8z"/></svg>'
    : '<svg viewBox="0 0 14 14"><path d="M2 1l11 6-11 6z"/></svg>';
}

header();
const dots = timeline(), curves = panels(), said = messages();
byId("slider").max = LAST;
byId("slider").addEventListener("input", (event) => { pause(); setTime(Number(event.target.value)); });
byId("play").addEventListener("click", toggle);
byId("speed").addEventListener("change", (event) => { if (film) film.playbackRate = Number(event.target.value); });
document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, button, summary") || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === " ") toggle();
  else if (event.key === "ArrowRight") { pause(); setTime(TIME[Math.min(tickAt(now) + 1, TIME.length - 1)]); }
  else if (event.key === "ArrowLeft") { pause(); setTime(TIME[Math.max(tickAt(now) - 1, 0)]); }
  else return;
  event.preventDefault();
});
showButton();
redraw();
let waiting = 0;
addEventListener("resize", () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(redraw); });
const asked = Number(new URLSearchParams(location.hash.slice(1)).get("t"));
if (asked > 0) setTime(asked);
