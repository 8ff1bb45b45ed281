"use strict";
// The table is DataTables', the plots are Plotly's; this script connects them by the policies that are ticked.

const ENTRIES = JSON.parse(document.getElementById("data").textContent);
// Okabe and Ito's colours, without those that are invisible on white or on black.
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#a0622d", "#8a8f98"];
const LIMITS = ["joint", "acceleration", "velocity", "stop"]; // colours of a joint by its limit
const MOST_ARMS = 4; // browsers keep few WebGL contexts
const [NEAR, BESIDE] = [0.8, 0.15]; // obstacles are shown within this share of the longest side of what moves, and others only beside it
const NEAREST = 0.01; // smallest cost above the best known on its axis, in [%]
const SMALLEST = 1e-10; // errors below are rounding, in [m] and [rad]
const CONFIG = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };

const element = (id) => document.getElementById(id);
const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;"); // Plotly reads HTML
const label = (entry, most = Infinity) => {
  const text = entry.policy + (entry.reference ? " *" : "");
  return escaped(text.length > most ? `${text.slice(0, most - 1)}…` : text);
};
const shown = (value) => (value === null || Number.isNaN(value) ? "–" : `${Number(value.toPrecision(4))}`);
const gap = [null, null, null];

// The table

const boxes = [...document.querySelectorAll("#results tbody input")];
const entryOf = (box) => ENTRIES[Number(box.value)];
const chosen = () => boxes.filter((box) => box.checked).map((box) => Number(box.value)).sort((a, b) => a - b).map((k) => ENTRIES[k]);
const colour = (entry) => {
  const place = chosen().indexOf(entry);
  return place < 0 ? themed("links") : COLOURS[place % COLOURS.length];
};

function tick(isTicked) {
  for (const box of boxes) box.checked = isTicked(box);
  for (const box of boxes) box.style.setProperty("--swatch", box.checked ? colour(entryOf(box)) : "transparent");
}

// The three cheapest policies of a scenario, contenders before references.
function tickBest(scenario) {
  const rank = (entry) => [entry.reference ? 1 : 0, entry.value ?? Infinity];
  const best = ENTRIES.filter((entry) => entry.scenario === scenario && entry.series)
    .sort((a, b) => rank(a)[0] - rank(b)[0] || rank(a)[1] - rank(b)[1]).slice(0, 3);
  tick((box) => best.includes(entryOf(box)));
}

function prepareTable() {
  const table = new DataTable("#results", { paging: false, order: [], autoWidth: false, columnDefs: [{ targets: 0, orderable: false }] });
  const scenarios = [...new Set(ENTRIES.map((entry) => entry.scenario))];
  element("scenarios").hidden = scenarios.length < 2;
  for (const name of ["", ...scenarios]) element("scenario").add(new Option(name || "all", name));
  element("scenario").addEventListener("change", ({ target }) => {
    table.column(2).search(target.value ? (cell) => cell === target.value : "").draw();
    tickBest(target.value || scenarios[0]);
    drawAll();
  });
  for (const box of boxes) {
    box.addEventListener("change", () => { // policies of another scenario follow another path
      tick((other) => other.checked && entryOf(other).scenario === entryOf(box).scenario);
      drawAll();
    });
  }
  tickBest(scenarios[0]);
}

// Arrays of an episode, base64 in the page

function array(entry, name) {
  const given = entry.series?.arrays[name];
  if (given === undefined || given.rows) return given?.rows;
  const bytes = Uint8Array.from(atob(given.data), (sign) => sign.charCodeAt(0));
  const values = given.type === "f4" ? new Float32Array(bytes.buffer) : bytes;
  const width = given.shape.slice(1).reduce((product, size) => product * size, 1);
  given.rows = Array.from({ length: given.shape[0] }, (_, k) => Array.from(values.subarray(k * width, (k + 1) * width)));
  return given.rows;
}
const column = (rows, j = 0) => rows.map((row) => row[j]);
const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, k) => flat.slice(3 * k, 3 * k + 3));

// Plots

const axis = (changes) => ({ gridcolor: themed("line"), zerolinecolor: themed("line"), linecolor: themed("quiet"), automargin: true, ...changes });
const layout = (changes) => ({
  paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", hoverlabel: { bgcolor: themed("card"), font: { color: themed("ink") } },
  font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: themed("ink") }, ...changes,
});

function drawCostTime() {
  const scenario = chosen()[0]?.scenario ?? ENTRIES[0]?.scenario;
  const all = ENTRIES.filter((entry) => entry.scenario === scenario);
  const ratio = all[0]?.quantity === "cost ratio";
  const height = (value) => (ratio ? Math.max(100 * (value - 1), NEAREST) : Math.max(value, 1e-12));
  const traces = all.filter((entry) => entry.time !== null && entry.value !== null).map((entry) => {
    const picked = chosen().includes(entry);
    const y = height(entry.value);
    const interval = entry.low === null ? "" : `<br>95 %: ${shown(entry.low)} … ${shown(entry.high)}`;
    return {
      x: [entry.time], y: [y], mode: picked ? "markers+text" : "markers", text: [label(entry)], textposition: "top center", cliponaxis: false,
      showlegend: false, hoverinfo: "text", hovertext: `<b>${label(entry)}</b><br>${entry.quantity} ${shown(entry.value)}${interval}<br>${shown(entry.time)} µs a step`,
      error_y: entry.low === null ? undefined : { type: "data", symmetric: false, array: [height(entry.high) - y], arrayminus: [y - height(entry.low)] },
      marker: { color: colour(entry), size: picked ? 13 : 9, symbol: entry.reference ? "diamond-open" : "circle" },
    };
  });
  return Plotly.react("cost-time", traces, layout({
    height: 440, margin: { l: 56, r: 24, t: 30, b: 44 }, hovermode: "closest",
    xaxis: axis({ type: "log", title: { text: "median time per step [µs]" } }),
    yaxis: axis({ type: "log", title: { text: ratio ? "cost above the best known [%]" : "total cost" }, exponentformat: "power" }),
  }), CONFIG);
}

// Panels over time, one above the other: { title, name, values(entry), limits, log }.
function drawPanels(id, panels, height) {
  const traces = [];
  const axes = {};
  const shapes = [];
  const annotations = [];
  const named = panels.some((panel) => panel.name);
  panels.forEach((panel, k) => {
    const place = k ? `${k + 1}` : "";
    const seen = [];
    for (const entry of chosen().filter((one) => panel.values(one))) {
      const y = panel.values(entry);
      seen.push(...y.filter(Number.isFinite));
      traces.push({
        x: column(array(entry, "time")), y, mode: "lines", line: { color: colour(entry), width: 1.6 }, name: label(entry),
        legendgroup: label(entry), showlegend: k === 0, xaxis: `x${place}`, yaxis: `y${place}`,
      });
    }
    const [low, high] = [Math.min(...seen), Math.max(...seen)];
    for (const limit of panel.limits ?? []) {
      if (limit === null || limit < low - (high - low) / 2 || limit > high + (high - low) / 2) continue;
      shapes.push({ type: "line", xref: `x${place} domain`, yref: `y${place}`, x0: 0, x1: 1, y0: limit, y1: limit, line: { color: themed("stop"), dash: "dot" } });
    }
    const corner = { xref: `x${place} domain`, yref: `y${place} domain`, x: 0, y: 1, xanchor: "left", yanchor: "bottom" };
    if (panel.name) annotations.push({ ...corner, text: escaped(panel.name), showarrow: false });
    const scale = panel.log ? { type: "log", exponentformat: "power", ...(high > 30 * low ? { dtick: 1 } : {}) } : {};
    axes[`yaxis${place}`] = axis({ title: { text: panel.title, standoff: 4 }, ...scale });
    axes[`xaxis${place}`] = axis({ matches: k ? "x" : undefined, title: { text: k === panels.length - 1 ? "time [s]" : "" } });
  });
  return Plotly.react(id, traces, layout({
    height: height * Math.max(panels.length, 1) + 70, margin: { l: 62, r: 16, t: 10, b: 44 }, shapes, annotations, ...axes,
    grid: { rows: Math.max(panels.length, 1), columns: 1, pattern: "independent", ygap: named ? 0.4 : 0.2 },
    legend: { orientation: "h", y: 1 + (named ? 20 : 4) / (height * Math.max(panels.length, 1)), yanchor: "bottom" },
  }), CONFIG);
}

function drawErrors() {
  const kinds = { position_error: "position error [m]", orientation_error: "orientation error [rad]" };
  const panels = Object.entries(kinds).filter(([name]) => chosen().some((entry) => array(entry, name))).map(([name, title]) => ({
    title, log: true, values: (entry) => array(entry, name)?.map(([error]) => (error < SMALLEST ? SMALLEST : error)),
  }));
  const clearance = { title: "clearance [m]", limits: [0], values: (entry) => array(entry, "clearance") && column(array(entry, "clearance")) };
  const collides = chosen().some(clearance.values);
  element("errors-head").textContent = collides ? "Errors and clearance over time" : "Errors over time";
  return drawPanels("errors", collides ? [...panels, clearance] : panels, 240);
}

function drawJoints() {
  const quantity = element("quantity").value;
  const series = chosen().find((entry) => array(entry, quantity))?.series;
  const [symbol, suffix] = { q: ["q", ""], qdot: ["q̇", "/s"], qddot: ["q̈", "/s²"] }[quantity];
  const bounds = { q: (j) => [series.lower[j], series.upper[j]], qdot: (j) => both(series.velocity_limit[j]), qddot: (j) => both(series.acceleration_limit?.[j]) }[quantity];
  const both = (limit) => (limit === null || limit === undefined ? [] : [-limit, limit]);
  return drawPanels("joints", (series?.prismatic ?? []).map((prismatic, joint) => ({
    title: `${symbol}<sub>${joint + 1}</sub> [${prismatic ? "m" : "rad"}${suffix}]`, name: series.joint_names[joint], limits: bounds(joint),
    values: (entry) => array(entry, quantity) && column(array(entry, quantity), joint),
  })), 150);
}

// The replay: one scene for each of the ticked policies, all at the same time of their episodes

const PLAYER = { arms: [], time: 0, end: 0, playing: false, last: 0, busy: false };
const xyz = (points) => ({ x: points.map((p) => p[0]), y: points.map((p) => p[1]), z: points.map((p) => p[2]) });
const rowAt = (entry, time) => Math.max(0, array(entry, "time").findLastIndex(([t]) => t <= time + 1e-9));

// The traces of an arm that move: actual path, links, joints, axes of the tool, reference position; bodies, obstacles, closest pair.
function moving({ entry, length }, k) {
  const points = triples(array(entry, "points")[k]);
  const tool = points.at(-1);
  const turned = array(entry, "rotation")[k];
  const axes = [0, 1, 2].flatMap((j) => [tool, tool.map((x, i) => x + length * turned[3 * i + j]), gap]);
  const path = array(entry, "points").slice(0, k + 1).map((row) => row.slice(-3));
  const usual = [path, points, entry.series.joint_ends.map((end) => points[end]), axes, [array(entry, "nominal")[k]]].map(xyz);
  if (!collides(entry)) return usual;
  const solids = xyz(solidsAt(entry, k));
  return [...usual, solids, solids, xyz(triples(array(entry, "closest")[k]))];
}
const collides = (entry) => array(entry, "surface") !== undefined;

// The vertices of bodies and obstacles in space.
function solidsAt(entry, k) {
  const frames = array(entry, "frames")[k];
  return array(entry, "surface").map(([x, y, z, carrier]) => [0, 1, 2].map((i) => {
    const turned = 12 * carrier + 3 * i;
    return frames[turned] * x + frames[turned + 1] * y + frames[turned + 2] * z + frames[12 * carrier + 9 + i];
  }));
}

// Bodies and obstacles have the same vertices, and other triangles.
function solidTraces(arm, scene) {
  if (!collides(arm.entry)) return [];
  const [bodies, obstacles, closest] = moving(arm, 0).slice(5);
  const triangles = array(arm.entry, "triangles");
  const count = arm.entry.series.of_bodies;
  const look = { type: "mesh3d", hoverinfo: "skip", showlegend: false, scene, flatshading: true, lighting: { ambient: 0.75, diffuse: 0.5 }, visible: element("bodies").checked };
  const mesh = (name, where, some, changes) => ({ ...look, name, ...where, i: column(some), j: column(some, 1), k: column(some, 2), ...changes });
  return [
    mesh("bodies", bodies, triangles.slice(0, count), { color: colour(arm.entry), opacity: 0.25 }),
    mesh("obstacles", obstacles, triangles.slice(count), { color: themed("obstacle"), opacity: 0.45 }),
    { ...look, ...closest, type: "scatter3d", mode: "lines", name: "closest pair", line: { color: themed("ink"), width: 4 } },
  ];
}
const states = (entry, k) => array(entry, "limit")[k].map((state) => themed(LIMITS[state]));

function armTraces(arm, number) {
  const line = (name, where, look) => ({ type: "scatter3d", mode: "lines", name, hoverinfo: "skip", showlegend: false, scene: `scene${number ? number + 1 : ""}`, line: look, ...where });
  const dots = (name, where, marker) => ({ ...line(name, where), mode: "markers", marker });
  const [path, links, joints, axes, target] = moving(arm, 0);
  const frame = ["x", "y", "z"].flatMap((name) => Array(3).fill(themed(name)));
  return [
    line("reference path", xyz(array(arm.entry, "nominal")), { color: themed("reference"), width: 3 }),
    line("actual path", path, { color: themed("actual"), width: 7 }), line("links", links, { color: themed("links"), width: 12 }),
    dots("joints", joints, { color: states(arm.entry, 0), size: 7, line: { color: themed("ink"), width: 1 } }),
    line("tool frame", axes, { color: frame, width: 6 }),
    dots("reference position", target, { color: themed("reference"), size: 6, symbol: "circle-open", line: { width: 2 } }),
    ...solidTraces(arm, `scene${number ? number + 1 : ""}`),
  ];
}

// Ranges that hold all paths and arms, and obstacles as far as they are near these; the same in all scenes.
function ranges(entries) {
  const values = entries.flatMap((entry) => [gap.map(() => 0), ...array(entry, "points").flatMap(triples), ...array(entry, "nominal")]);
  const within = (points) => [0, 1, 2].map((i) => points.reduce(([low, high], p) => (Number.isFinite(p[i]) ? [Math.min(low, p[i]), Math.max(high, p[i])] : [low, high]), [0, 0]));
  const arms = within(values);
  const size = Math.max(...arms.map(([low, high]) => high - low));
  const held = (p, share) => p.map((x, i) => Math.min(Math.max(x, arms[i][0] - share * size), arms[i][1] + share * size));
  const solids = entries.filter(collides).flatMap((entry) => solidsAt(entry, 0));
  const ends = within([...values, ...solids.map((p) => (held(p, NEAR).every((x, i) => x === p[i]) ? p : held(p, BESIDE)))]);
  const longest = Math.max(...ends.map(([low, high]) => high - low), 1e-3);
  return ends.map(([low, high]) => { // nothing can be seen in a flat box
    const half = Math.max(high - low, 0.6 * longest) / 2 + 0.05 * longest;
    return [(low + high) / 2 - half, (low + high) / 2 + half];
  });
}

async function drawReplay() {
  const entries = chosen().filter((entry) => array(entry, "points")).slice(0, MOST_ARMS);
  const box = entries.length ? ranges(entries) : [];
  const length = Math.max(0, ...box.map(([low, high]) => 0.1 * (high - low)));
  PLAYER.arms = entries.map((entry) => ({ entry, length }));
  PLAYER.arms.reduce((first, arm) => { arm.first = first; return first + (collides(arm.entry) ? 9 : 6); }, 0);
  PLAYER.end = Math.max(0, ...entries.map((entry) => array(entry, "time").at(-1)[0]));
  PLAYER.time = Math.min(PLAYER.time, PLAYER.end);
  element("time").max = PLAYER.end;
  element("play").disabled = !entries.length;
  for (const part of document.querySelectorAll(".contacts")) part.hidden = !entries.some(collides);
  const columns = element("replay").clientWidth > 720 ? Math.min(entries.length, 2) : 1;
  const rows = Math.ceil(entries.length / Math.max(columns, 1));
  const side = (k, name) => ({ range: box[k], title: { text: `${name} [m]` }, nticks: 5, gridcolor: themed("line"), backgroundcolor: themed("card"), color: themed("quiet"), showspikes: false });
  const camera = element("replay").layout?.scene?.camera ?? { eye: { x: 1, y: 1, z: 0.5 }, projection: { type: "orthographic" } };
  const scenes = Object.fromEntries(entries.map((_, k) => [`scene${k ? k + 1 : ""}`, {
    domain: { row: Math.floor(k / columns), column: k % columns }, xaxis: side(0, "x"), yaxis: side(1, "y"), zaxis: side(2, "z"),
    aspectmode: "data", dragmode: "turntable", camera,
  }]));
  const without = chosen().filter((entry) => !array(entry, "points")).map((entry) => entry.policy);
  const [first] = entries;
  element("replay-note").textContent = [
    first ? `${first.scenario}${first.seed ? `, seed ${first.seed}` : ""}.` : "No policy with a trajectory log is ticked.",
    first && array(first, "time").length < first.series.rows ? `${array(first, "time").length} of ${first.series.rows} steps are shown; errors, velocities and accelerations are the largest since the step before.` : "",
    without.length ? `No trajectory log of ${without.join(", ")} in this folder.` : "", chosen().length > MOST_ARMS ? `The first ${MOST_ARMS} policies are shown.` : "",
  ].join(" ");
  await Plotly.react("replay", PLAYER.arms.flatMap(armTraces), layout({
    height: 420 * Math.max(rows, 0.2), margin: { l: 0, r: 0, t: 40, b: 0 }, showlegend: false, grid: { rows: Math.max(rows, 1), columns: Math.max(columns, 1), ygap: 0.12, xgap: 0.02 }, ...scenes,
  }), { ...CONFIG, displayModeBar: false });
  await seek(PLAYER.time);
}

// The words above each scene.
function words({ entry }, k, number) {
  const { x, y } = element("replay")._fullLayout[`scene${number ? number + 1 : ""}`].domain;
  const width = element("replay").clientWidth * (x[1] - x[0]);
  const one = (name, unit) => (array(entry, name) ? `${shown(1e3 * array(entry, name)[k][0])} ${unit}` : "");
  const errors = [one("position_error", "mm"), one("orientation_error", "mrad")].filter(Boolean).join(", ");
  const clearance = collides(entry) ? `, clearance ${one("clearance", "mm")}` : "";
  const below = `error ${errors}${clearance}`;
  const longest = Math.max(entry.policy.length + 2, below.length);
  return {
    text: `<b>${label(entry, Math.floor(width / 6))}</b><br>${below}`,
    font: { size: Math.min(Math.max((1.6 * width) / longest, 9), 12) }, // plots do not break lines
    xref: "paper", yref: "paper", x: x[0], y: y[1], xanchor: "left", yanchor: "bottom", align: "left",
    showarrow: false, bordercolor: colour(entry), borderpad: 3,
  };
}

async function seek(time) {
  PLAYER.time = Math.min(Math.max(time, 0), PLAYER.end);
  element("time").value = PLAYER.time;
  element("clock").textContent = `${PLAYER.time.toFixed(3)} s`;
  if (PLAYER.busy || !PLAYER.arms.length) return;
  PLAYER.busy = true;
  const update = { x: [], y: [], z: [], "marker.color": [] };
  const places = [];
  const annotations = PLAYER.arms.map((arm, number) => {
    const k = rowAt(arm.entry, PLAYER.time);
    moving(arm, k).forEach((points, trace) => {
      places.push(arm.first + trace + 1);
      for (const name of "xyz") update[name].push(points[name]);
      update["marker.color"].push(trace === 2 ? states(arm.entry, k) : trace === 4 ? themed("reference") : undefined);
    });
    return words(arm, k, number);
  });
  await Plotly.update("replay", update, { annotations }, places).finally(() => { PLAYER.busy = false; });
}

async function play(now) {
  if (!PLAYER.playing) return;
  const passed = Math.min(Math.max(now - PLAYER.last, 0), 100) / 1e3; // where drawing is slow the replay is, too
  PLAYER.last = now;
  await seek(PLAYER.time + passed * Number(element("speed").value));
  if (PLAYER.time >= PLAYER.end) setPlaying(false);
  else requestAnimationFrame(play);
}

function setPlaying(playing) {
  PLAYER.playing = playing;
  element("play").textContent = playing ? "Pause" : "Play";
  if (!playing) return;
  if (PLAYER.time >= PLAYER.end) PLAYER.time = 0;
  PLAYER.last = performance.now();
  requestAnimationFrame(play);
}

// Turning one scene turns all of them.
function turnTogether(change) {
  const camera = Object.entries(change).find(([key]) => /^scene\d*\.camera$/.test(key))?.[1];
  if (!camera || PLAYER.turning) return;
  PLAYER.turning = true;
  const all = Object.fromEntries(PLAYER.arms.map((_, k) => [`scene${k ? k + 1 : ""}.camera`, camera]));
  Plotly.relayout("replay", all).finally(() => { PLAYER.turning = false; });
}

async function drawAll() {
  if (!globalThis.Plotly) return;
  for (const draw of [drawCostTime, drawErrors, drawJoints, drawReplay]) await draw();
}

// The table works at once; Plotly, which is large, is read when it has been painted.
async function begin() {
  const library = document.createElement("script");
  library.textContent = element("plotly").textContent;
  document.head.append(library);
  await drawAll();
  element("replay").on("plotly_relayout", turnTogether);
  element("play").addEventListener("click", () => setPlaying(!PLAYER.playing));
  element("time").addEventListener("input", ({ target }) => seek(Number(target.value)));
  element("quantity").addEventListener("change", drawJoints);
  element("bodies").addEventListener("change", drawReplay);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  document.documentElement.dataset.ready = "yes";
}

prepareTable();
requestAnimationFrame(() => setTimeout(begin));
