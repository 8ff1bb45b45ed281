// Costs against times, and errors over time.

const NEAREST = 1e-4; // by how much a cost ratio exceeds 1 at the lower end of its axis at most
const SMALLEST = 1e-10; // errors below are rounding, in [m] and [rad]
const LETTER = [6.5, 14]; // width and height of one, about, in [px]

// The scenario whose policies are compared: that of the pictures.
const current = () => chosen()[0]?.scenario ?? (element("scenario").value || DATA.entries[0]?.scenario);

// The axis of a cost ratio is logarithmic in what it exceeds 1 by.
const height = (value, ratio) => (ratio ? Math.max(value - 1, NEAREST) : Math.max(value, 1e-12));

// At 1.0001, 1.001, …, 2, 10, 100, …: where each stands on the axis, and what it is called.
function costRatioTicks() {
  const ratios = [...[-4, -3, -2, -1, 0].map((k) => 1 + 10 ** k), ...Array.from({ length: 15 }, (_, k) => 10 ** (k + 1))];
  const text = (ratio) => (ratio < 1e4 ? shown(ratio) : `10<sup>${Math.round(Math.log10(ratio))}</sup>`);
  return { tickvals: ratios.map((ratio) => ratio - 1), ticktext: ratios.map(text) };
}

// Where the name of each point stands, in [px]; "" where it would hide another one: hovering shows it. First come, first served.
function textPositions(points, names, limit) {
  const boxes = points.map(([x, y]) => [x - 6, x + 6, y - 6, y + 6]);
  const apart = (a, b) => a[1] < b[0] || a[0] > b[1] || a[3] < b[2] || a[2] > b[3];
  const free = (box) => box[0] > 0 && box[1] < limit && boxes.every((other) => apart(box, other));
  return points.map(([x, y], k) => {
    const [width, height] = [LETTER[0] * names[k].length, LETTER[1]];
    const sides = {
      "top center": [x - width / 2, x + width / 2, y - 8 - height, y - 8],
      "bottom center": [x - width / 2, x + width / 2, y + 8, y + 8 + height],
      "middle right": [x + 9, x + 9 + width, y - height / 2, y + height / 2],
      "middle left": [x - 9 - width, x - 9, y - height / 2, y + height / 2],
    };
    const side = Object.keys(sides).find((name) => free(sides[name])) ?? "";
    if (side) boxes.push(sides[side]);
    return side;
  });
}

// A point of the picture of costs and times, with its interval.
function costPoint(entry, ratio) {
  const y = height(entry.value, ratio);
  const bar = entry.low === null ? undefined : {
    type: "data", symmetric: false, thickness: 1.5, width: 4,
    array: [height(entry.high, ratio) - y], arrayminus: [y - height(entry.low, ratio)],
  };
  const between = entry.low === null ? "" : `<br>95 %: ${shown(entry.low)} … ${shown(entry.high)}`;
  const [look, picked] = [looks(entry), chosen().includes(entry)];
  return {
    type: "scatter", mode: "markers", x: [entry.time], y: [y], error_y: bar, cliponaxis: false, showlegend: false,
    text: [escaped(label(entry))], textfont: { size: picked ? 12 : 10.5, color: themed(picked ? "ink" : "quiet") },
    marker: {
      color: look.color, size: picked ? 13 : 9, symbol: entry.reference ? "diamond-open" : "circle",
      line: { color: entry.reference ? look.color : themed("card"), width: entry.reference ? 2 : 1 },
    },
    hoverinfo: "text",
    hovertext: `<b>${escaped(label(entry))}</b><br>${entry.quantity} ${shown(entry.value)}${between}` +
      `<br>${shown(entry.time)} µs a step`,
  };
}

// Names go where the points, once drawn, leave room for them.
async function nameCostPoints(entries) {
  const drawn = element("cost-time");
  const { xaxis, yaxis, height: outer, margin } = drawn.layout;
  const share = ({ range }, value) => (Math.log10(value) - range[0]) / (range[1] - range[0]);
  const [width, tall] = [drawn.clientWidth - margin.l - margin.r, outer - margin.t - margin.b];
  const places = drawn.data.map(({ x, y }) => [width * share(xaxis, x[0]), tall * (1 - share(yaxis, y[0]))]);
  const positions = textPositions(places, entries.map(label), width);
  const modes = positions.map((side) => (side ? "markers+text" : "markers"));
  if (modes.length) await Plotly.restyle(drawn, { mode: modes, textposition: positions.map((side) => side || "top center") });
}

async function drawCostTime() {
  const all = DATA.entries.filter((entry) => entry.scenario === current());
  const ratio = all.every((entry) => entry.quantity === "cost ratio");
  const usable = all.filter((e) => e.time !== null && e.value !== null && (ratio || e.quantity === "total cost"));
  const picked = chosen();
  usable.sort((a, b) => picked.includes(b) - picked.includes(a) || a.value - b.value);
  const ticks = ratio ? costRatioTicks() : { exponentformat: "power", dtick: 1 };
  const missing = all.length - usable.length;
  element("cost-note").textContent =
    (ratio ? "The axis of the cost ratio is logarithmic in what it exceeds 1 by. " : "") +
    (missing ? `${missing} without a time or a finite cost ${missing === 1 ? "is" : "are"} not shown.` : "");
  await Plotly.react("cost-time", usable.map((entry) => costPoint(entry, ratio)), layout({
    height: 440, margin: { l: 56, r: 24, t: 20, b: 44 }, hovermode: "closest",
    xaxis: axis({ type: "log", title: { text: "median time per step [µs]" }, dtick: "D2" }),
    yaxis: axis({ type: "log", title: { text: ratio ? "cost ratio" : "total cost" }, ...ticks }),
  }), CONFIG);
  await nameCostPoints(usable);
}

// A line in the colour of a policy; `place` is the number of its panel, as names of axes have it.
function curve(entry, x, y, place, rest) {
  const look = looks(entry);
  return {
    type: "scatter", mode: "lines", x, y, line: { color: look.color, dash: look.dash, width: 1.6 },
    name: escaped(label(entry)), legendgroup: label(entry), showlegend: false,
    xaxis: `x${place}`, yaxis: `y${place}`, ...rest,
  };
}

const withSeries = () => chosen().filter((entry) => entry.series);

function drawErrors() {
  const kinds = { position_error: "position error [m]", orientation_error: "orientation error [rad]" };
  const entries = withSeries();
  const present = Object.keys(kinds).filter((kind) => entries.some((entry) => entry.series.arrays[kind]));
  const traces = [];
  const axes = {};
  present.forEach((kind, k) => {
    const place = k === 0 ? "" : `${k + 1}`;
    for (const entry of entries.filter((one) => one.series.arrays[kind])) {
      const errors = column(array(entry, kind), 0).map((value) => (value < SMALLEST ? SMALLEST : value));
      traces.push(curve(entry, column(array(entry, "time"), 0), errors, place, { showlegend: k === 0 }));
    }
    axes[`yaxis${place}`] = axis({ type: "log", title: { text: kinds[kind] }, exponentformat: "power", dtick: 1 });
    const last = k === present.length - 1;
    axes[`xaxis${place}`] = axis({ title: { text: last ? "time [s]" : "" }, matches: k ? "x" : undefined });
  });
  Plotly.react("errors", traces, layout({
    height: Math.max(260 * present.length, 120) + 40, margin: { l: 62, r: 16, t: 10, b: 44 },
    grid: { rows: Math.max(present.length, 1), columns: 1, pattern: "independent", ygap: 0.18 },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom" }, shapes: present.map((_, k) => cursor(k)), ...axes,
  }), CONFIG);
}

// Where the replay stands.
function cursor(panel) {
  const place = panel === 0 ? "" : `${panel + 1}`;
  return {
    type: "line", xref: `x${place}`, yref: `y${place} domain`, x0: PLAYER.time, x1: PLAYER.time, y0: 0, y1: 1,
    line: { color: themed("quiet"), width: 1.2, dash: "dot" },
  };
}

function moveCursor() {
  const drawn = element("errors");
  const shapes = drawn.layout?.shapes ?? [];
  if (shapes.length) {
    const moves = shapes.flatMap((_, k) => [[`shapes[${k}].x0`, PLAYER.time], [`shapes[${k}].x1`, PLAYER.time]]);
    Plotly.relayout(drawn, Object.fromEntries(moves));
  }
}
