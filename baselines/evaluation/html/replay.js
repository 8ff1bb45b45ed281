// The replay: an arm in space for each of the chosen policies, all at the same time of their episodes.

const MOST_SCENES = 4; // browsers keep few WebGL contexts
const CURSOR_EVERY = 150; // [ms] between two moves of the line in the plots of errors: drawing them takes a while
const LONGEST = 100; // [ms] that a picture may move the replay on, at its speed
const PLAYER = { time: 0, end: 0, turn: 0, playing: false, last: 0, busy: false, moved: 0, scenes: [] };
const LIMITS = ["joint", "acceleration", "velocity", "stop"];
const LIMIT_WORDS = ["", "acceleration limit", "velocity limit", "stop"];

const WEBGL = (() => {
  const canvas = document.createElement("canvas");
  return Boolean(canvas.getContext("webgl2") ?? canvas.getContext("webgl"));
})();

// Points as traces: in space, or where there is no WebGL in a fixed view from the front, the right and above.
function placed(points) {
  if (WEBGL) return { x: points.map((p) => p[0]), y: points.map((p) => p[1]), z: points.map((p) => p[2]) };
  const [c, s] = [Math.SQRT1_2, 0.5];
  return {
    x: points.map((p) => (p[0] === null ? null : c * (p[1] - p[0]))),
    y: points.map((p) => (p[0] === null ? null : c * p[2] - s * c * (p[0] + p[1]))),
  };
}

const GAP = [null, null, null];
const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, k) => flat.slice(3 * k, 3 * k + 3));

// The last row that is not after a time.
function rowAt(entry, time) {
  const { values } = array(entry, "time");
  let [low, high] = [0, values.length - 1];
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (values[middle] <= time + 1e-9) low = middle;
    else high = middle - 1;
  }
  return low;
}

// What moves, after so many rows: the actual path, the links, the joints, the tool's axes, the target.
function moving(scene, k) {
  const { entry } = scene;
  const points = triples(row(array(entry, "points"), k));
  const tool = points[points.length - 1];
  const turned = row(array(entry, "rotation"), k);
  const axes = [0, 1, 2].flatMap((j) => [tool, tool.map((x, i) => x + scene.length * turned[3 * i + j]), GAP]);
  const joints = entry.series.joint_ends.map((end) => points[end]);
  const states = row(array(entry, "limit"), k);
  return {
    at: [scene.path.slice(0, k + 1), points, joints, axes, [row(array(entry, "nominal"), k)]].map(placed),
    colours: states.map((state) => themed(LIMITS[state])), sizes: states.map((state) => (state ? 11 : 7)), states,
  };
}

function traces(scene) {
  const kind = WEBGL ? { type: "scatter3d" } : { type: "scatter" };
  const line = (name, points, look, rest) =>
    ({ ...kind, name, mode: "lines", hoverinfo: "skip", showlegend: false, line: look, ...placed(points), ...rest });
  const { at, colours, sizes } = moving(scene, 0);
  const reference = triples(Array.from(array(scene.entry, "nominal").values));
  const axisColours = ["x", "y", "z"].flatMap((name) => Array(3).fill(themed(name)));
  const frame = WEBGL ? { color: axisColours, width: 6 } : { color: themed("x"), width: 2.5 };
  const dots = (name, marker, where) => ({ ...line(name, [], {}), mode: "markers", marker, ...where });
  return [
    line("reference path", reference, { color: themed("reference"), width: 3 }),
    { ...line("actual path", [], { color: themed("actual"), width: WEBGL ? 7 : 4 }), ...at[0] },
    { ...line("links", [], { color: themed("links"), width: WEBGL ? 12 : 5 }), ...at[1] },
    dots("joints", { color: colours, size: sizes, line: { color: themed("ink"), width: 1 } }, at[2]),
    { ...line("tool frame", [], frame), ...at[3] },
    dots("target", { color: themed("reference"), size: 6, symbol: "circle-open", line: { width: 2 } }, at[4]),
  ];
}

// Ranges that hold all paths and arms of a scenario, so that the scenes can be compared.
function ranges(entries) {
  const low = [0, 0, 0];
  const high = [0, 0, 0];
  for (const entry of entries) {
    for (const name of ["points", "nominal"]) {
      array(entry, name).values.forEach((value, k) => {
        if (!Number.isFinite(value)) return;
        low[k % 3] = Math.min(low[k % 3], value);
        high[k % 3] = Math.max(high[k % 3], value);
      });
    }
  }
  const longest = Math.max(...high.map((value, i) => value - low[i]), 1e-3);
  // In a flat box nothing can be seen.
  return high.map((value, i) => {
    const middle = (value + low[i]) / 2;
    const half = Math.max(value - low[i], 0.6 * longest) / 2 + 0.05 * longest;
    return [middle - half, middle + half];
  });
}

function sceneLayout(box) {
  const flat = { margin: { l: 8, r: 8, t: 8, b: 8 }, showlegend: false };
  if (!WEBGL) {
    const hidden = { visible: false };
    return layout({ ...flat, xaxis: { ...hidden, scaleanchor: "y" }, yaxis: hidden });
  }
  const sides = (k, name) => ({
    range: box[k], title: { text: `${name} [m]`, font: { size: 11 } }, nticks: 5, tickfont: { size: 10 },
    gridcolor: themed("line"), zerolinecolor: themed("line"), backgroundcolor: themed("card"), color: themed("quiet"),
    showspikes: false,
  });
  return layout({ ...flat, margin: { l: 0, r: 0, t: 0, b: 0 }, scene: {
    xaxis: sides(0, "x"), yaxis: sides(1, "y"), zaxis: sides(2, "z"), aspectmode: "data", dragmode: "turntable",
    camera: { eye: { x: 1.15, y: 1.15, z: 0.6 }, projection: { type: "orthographic" } },
  } });
}

function figureFor(scene) {
  const figure = document.createElement("figure");
  const caption = document.createElement("figcaption");
  const name = document.createElement("b");
  name.textContent = label(scene.entry);
  name.style.setProperty("--swatch", looks(scene.entry).color);
  scene.words = document.createElement("span");
  caption.append(name, scene.words);
  scene.plot = document.createElement("div");
  scene.plot.className = "scene";
  figure.append(caption, scene.plot);
  return figure;
}

// Turning one scene turns all of them.
function turnTogether(scene) {
  scene.plot.on("plotly_relayout", (change) => {
    const camera = change["scene.camera"];
    if (!camera || PLAYER.turning) return; // the others say so, too
    PLAYER.turning = true;
    const others = PLAYER.scenes.filter((other) => other !== scene);
    Promise.all(others.map((other) => Plotly.relayout(other.plot, { "scene.camera": camera })))
      .finally(() => { PLAYER.turning = false; });
  });
}

async function drawReplay() {
  const turn = (PLAYER.turn += 1);
  for (const scene of PLAYER.scenes) Plotly.purge(scene.plot);
  const picked = chosen();
  const able = picked.filter((entry) => entry.series?.arrays.points);
  const entries = able.slice(0, MOST_SCENES);
  const box = entries.length ? ranges(entries) : [];
  const length = Math.max(0, ...box.map(([low, high]) => 0.1 * (high - low)));
  PLAYER.scenes = entries.map((entry) => {
    const path = Array.from({ length: array(entry, "points").shape[0] }, (_, k) => {
      const { values, width } = array(entry, "points");
      return Array.from(values.subarray((k + 1) * width - 3, (k + 1) * width));
    });
    return { entry, path, length };
  });
  element("replay").replaceChildren(...PLAYER.scenes.map(figureFor));
  explain(picked, able, entries);
  PLAYER.end = Math.max(0, ...entries.map((entry) => array(entry, "time").values.at(-1)));
  PLAYER.time = Math.min(PLAYER.time, PLAYER.end);
  element("time").max = PLAYER.end;
  element("play").disabled = !entries.length;
  for (const scene of PLAYER.scenes) {
    await Plotly.newPlot(scene.plot, traces(scene), sceneLayout(box), { ...CONFIG, displayModeBar: false });
    if (turn !== PLAYER.turn) return; // another choice was made meanwhile
    if (WEBGL) turnTogether(scene);
  }
  await showTime();
}

// What is not shown, and why.
function explain(picked, able, entries) {
  const parts = [];
  if (!picked.length) parts.push("No policy is ticked.");
  const without = picked.filter((entry) => !able.includes(entry));
  if (without.length) parts.push(`No series of ${without.map(label).join(", ")} in this folder: it was played elsewhere or before.`);
  if (able.length > entries.length) parts.push(`The first ${MOST_SCENES} of ${able.length} policies are shown.`);
  if (entries.length) {
    const { series, scenario, seed } = entries[0];
    const kept = array(entries[0], "time").shape[0];
    parts.push(`${scenario}${seed ? `, seed ${seed}` : ""}.`);
    if (kept < series.rows) {
      parts.push(`Series are thinned to ${kept} of ${series.rows} steps: errors, velocities and accelerations are the ` +
        "largest since the step before, and so are the limits.");
    }
  }
  if (!WEBGL) parts.push("This browser has no WebGL: the arms are shown in a fixed view.");
  element("replay-note").textContent = parts.join(" ");
}

function wordsOf(scene, k, states) {
  const { entry } = scene;
  const one = (name, unit) => (entry.series.arrays[name] ? `${shown(1e3 * array(entry, name).values[k])} ${unit}` : "");
  const errors = [one("position_error", "mm"), one("orientation_error", "mrad")].filter(Boolean).join(", ");
  const held = states.map((state, j) => (state ? `joint ${j + 1} at its ${LIMIT_WORDS[state]}` : "")).filter(Boolean);
  return `error ${errors}${held.length ? ` · ${held.join(", ")}` : ""}`;
}

async function showTime() {
  element("time").value = PLAYER.time;
  element("clock").textContent = `${PLAYER.time.toFixed(PLAYER.end < 100 ? 3 : 1)} s`;
  const moves = PLAYER.scenes.map((scene) => {
    const k = rowAt(scene.entry, PLAYER.time);
    const { at, colours, sizes, states } = moving(scene, k);
    scene.words.textContent = wordsOf(scene, k, states);
    const keys = Object.keys(at[0]);
    const places = Object.fromEntries(keys.map((key) => [key, at.map((points) => points[key])]));
    const joints = at.map((_, trace) => (trace === 2 ? { ...scene.plot.data[3].marker, color: colours, size: sizes } : undefined));
    return Plotly.restyle(scene.plot, { ...places, marker: joints }, [1, 2, 3, 4, 5]);
  });
  await Promise.all(moves);
}

async function seek(time) {
  PLAYER.time = Math.min(Math.max(time, 0), PLAYER.end);
  if (PLAYER.busy) return;
  PLAYER.busy = true;
  await showTime();
  PLAYER.busy = false;
  if (performance.now() - PLAYER.moved > CURSOR_EVERY || !PLAYER.playing) {
    PLAYER.moved = performance.now();
    moveCursor();
  }
}

function setPlaying(playing) {
  PLAYER.playing = playing;
  element("play").textContent = playing ? "Pause" : "Play";
  if (!playing) return moveCursor();
  if (PLAYER.time >= PLAYER.end) PLAYER.time = 0;
  PLAYER.last = performance.now();
  return requestAnimationFrame(tick);
}

async function tick(now) {
  if (!PLAYER.playing) return;
  // Where a picture takes long, the replay is slower than it should be, and skips nothing.
  const passed = Math.min(Math.max(now - PLAYER.last, 0), LONGEST) / 1e3;
  PLAYER.last = now;
  await seek(PLAYER.time + passed * Number(element("speed").value));
  if (PLAYER.time >= PLAYER.end) setPlaying(false);
  else requestAnimationFrame(tick);
}

// By a picture, forward or backward.
function stepBy(pictures) {
  const scene = PLAYER.scenes[0];
  if (!scene) return;
  const { values } = array(scene.entry, "time");
  const k = Math.min(Math.max(rowAt(scene.entry, PLAYER.time) + pictures, 0), values.length - 1);
  seek(values[k]);
}

function preparePlayer() {
  element("play").addEventListener("click", () => setPlaying(!PLAYER.playing));
  element("time").addEventListener("input", (event) => seek(Number(event.target.value)));
  const keys = {
    " ": () => setPlaying(!PLAYER.playing), ArrowLeft: () => stepBy(-1), ArrowRight: () => stepBy(1),
    Home: () => seek(0), End: () => seek(PLAYER.end),
  };
  document.addEventListener("keydown", (event) => {
    const own = event.target.closest("input, select, button, summary, a, .scroll"); // has keys of its own
    if (!(event.key in keys) || (own && own.id !== "time") || !PLAYER.scenes.length) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    keys[event.key]();
  });
}
