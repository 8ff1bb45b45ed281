// The replay: an arm in space for each of the chosen policies, all at the same time of their episodes.

const MOST_SCENES = 4; // browsers keep few WebGL contexts
const CURSOR_EVERY = 150; // [ms] between two moves of the line in the plots of errors: drawing them takes a while
const LONGEST = 100; // [ms] that a picture may move the replay on, at its speed
const PLAYER = {
  time: 0, end: 0, playing: false, last: 0, busy: false, moved: 0, turning: false, camera: VIEWS.oblique, box: [], scenes: [],
};
const LIMIT_WORDS = ["", "acceleration limit", "velocity limit", "stop"];

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

// Turning one scene turns all of them, and those that are drawn later.
async function turn(camera, from) {
  PLAYER.camera = camera;
  const others = PLAYER.scenes.filter((scene) => scene !== from && scene.plot.data);
  await Promise.all(others.map((scene) => Plotly.relayout(scene.plot, { "scene.camera": camera })));
}

function turnTogether(scene) {
  scene.plot.on("plotly_relayout", async (change) => {
    const camera = change["scene.camera"];
    if (!camera || PLAYER.turning) return; // the others say so, too
    PLAYER.turning = true;
    await turn(camera, scene).finally(() => { PLAYER.turning = false; });
  });
}

// Space is costly to draw, above all without a graphics card: a scene is drawn, and moved, when it is in sight.
const SIGHT = new IntersectionObserver((changes) => {
  for (const { target, isIntersecting } of changes) {
    const scene = PLAYER.scenes.find((one) => one.plot === target);
    if (scene) scene.inSight = isIntersecting;
  }
  refresh();
});

const isStale = (scene) => scene.inSight && scene.at !== PLAYER.time && scene.plot.isConnected;

// Brings all scenes in sight to the time of the replay, one after another, until none is behind.
async function refresh() {
  if (PLAYER.busy) return;
  PLAYER.busy = true;
  try {
    while (PLAYER.scenes.some(isStale)) {
      for (const scene of PLAYER.scenes.filter(isStale)) {
        await bring(scene);
        await painted();
      }
    }
  } finally {
    PLAYER.busy = false;
  }
}

async function bring(scene) {
  scene.at = PLAYER.time;
  const k = rowAt(scene.entry, scene.at);
  scene.words.textContent = wordsOf(scene, k);
  if (scene.plot.data) return move(scene, k);
  await Plotly.newPlot(scene.plot, traces(scene, k), sceneLayout(PLAYER.box), { ...CONFIG, displayModeBar: false });
  if (!scene.plot.isConnected) return Plotly.purge(scene.plot); // another choice was made meanwhile
  return WEBGL && turnTogether(scene);
}

function move(scene, k) {
  const { at, colours, sizes } = moving(scene, k);
  const places = Object.fromEntries(Object.keys(at[0]).map((key) => [key, at.map((points) => points[key])]));
  const joints = { ...scene.plot.data[3].marker, color: colours, size: sizes };
  return Plotly.restyle(scene.plot, { ...places, marker: at.map((_, trace) => (trace === 2 ? joints : undefined)) },
    [1, 2, 3, 4, 5]);
}

function sceneOf(entry, length) {
  const { values, width, shape } = array(entry, "points");
  const tool = (k) => Array.from(values.subarray((k + 1) * width - 3, (k + 1) * width));
  return { entry, length, path: Array.from({ length: shape[0] }, (_, k) => tool(k)) };
}

function drawReplay() {
  SIGHT.disconnect();
  for (const scene of PLAYER.scenes) if (scene.plot.data) Plotly.purge(scene.plot);
  const picked = chosen();
  const able = picked.filter((entry) => entry.series?.arrays.points);
  const entries = able.slice(0, MOST_SCENES);
  PLAYER.box = entries.length ? ranges(entries) : [];
  const length = Math.max(0, ...PLAYER.box.map(([low, high]) => 0.1 * (high - low)));
  PLAYER.scenes = entries.map((entry) => sceneOf(entry, length));
  element("replay").replaceChildren(...PLAYER.scenes.map(figureFor));
  explain(picked, able, entries);
  PLAYER.end = Math.max(0, ...entries.map((entry) => array(entry, "time").values.at(-1)));
  PLAYER.time = Math.min(PLAYER.time, PLAYER.end);
  element("time").max = PLAYER.end;
  element("play").disabled = !entries.length;
  showClock();
  for (const scene of PLAYER.scenes) SIGHT.observe(scene.plot);
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
  if (!WEBGL) parts.push("This browser has no WebGL: the arms are shown in a fixed view, all axes of the tool in one colour.");
  element("replay-note").textContent = parts.join(" ");
}

function wordsOf({ entry }, k) {
  const one = (name, unit) => (entry.series.arrays[name] ? `${shown(1e3 * array(entry, name).values[k])} ${unit}` : "");
  const errors = [one("position_error", "mm"), one("orientation_error", "mrad")].filter(Boolean).join(", ");
  const states = row(array(entry, "limit"), k);
  const held = states.map((state, j) => (state ? `joint ${j + 1} at its ${LIMIT_WORDS[state]}` : "")).filter(Boolean);
  return `error ${errors}${held.length ? ` · ${held.join(", ")}` : ""}`;
}

function showClock() {
  element("time").value = PLAYER.time;
  element("clock").textContent = `${PLAYER.time.toFixed(PLAYER.end < 100 ? 3 : 1)} s`;
}

async function seek(time) {
  PLAYER.time = Math.min(Math.max(time, 0), PLAYER.end);
  showClock();
  await refresh();
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
  const { entry } = PLAYER.scenes[0];
  const { values } = array(entry, "time");
  seek(values[Math.min(Math.max(rowAt(entry, PLAYER.time) + pictures, 0), values.length - 1)]);
}

// Whether a key is meant for the replay: it is in sight, and nothing that has keys of its own has the focus.
function isMeant({ key, target, ctrlKey, altKey, metaKey }) {
  if (ctrlKey || altKey || metaKey || !PLAYER.scenes.some((scene) => scene.inSight)) return false;
  const own = target.closest("input, select, button, summary, a, .scroll");
  return !own || own.id === "time" || (own.id === "play" && key !== " ");
}

function preparePlayer() {
  element("play").addEventListener("click", () => setPlaying(!PLAYER.playing));
  element("time").addEventListener("input", (event) => seek(Number(event.target.value)));
  element("view").addEventListener("change", (event) => turn(VIEWS[event.target.value]));
  element("view").closest("div").hidden = !WEBGL;
  const keys = {
    " ": () => setPlaying(!PLAYER.playing), ArrowLeft: () => stepBy(-1), ArrowRight: () => stepBy(1),
    Home: () => seek(0), End: () => seek(PLAYER.end),
  };
  document.addEventListener("keydown", (event) => {
    if (!(event.key in keys) || !isMeant(event)) return;
    event.preventDefault();
    keys[event.key]();
  });
}
