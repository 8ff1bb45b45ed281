// Costs against times, and errors over time.

const NEAREST = 1e-4; // by how much a cost ratio exceeds 1 at the lower end of its axis at most
const SMALLEST = 1e-10; // errors below are rounding, in [m] and [rad]
const NAMED = 14; // of more policies, only the chosen ones have their names beside their points

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

function drawCostTime() {
  const all = DATA.entries.filter((entry) => entry.scenario === current());
  const ratio = all.every((entry) => entry.quantity === "cost ratio");
  const usable = all.filter((e) => e.time !== null && e.value !== null && (ratio || e.quantity === "total cost"));
  const picked = new Set(chosen());
  usable.sort((a, b) => a.time - b.time);
  const points = usable.map((entry, place) => {
    const y = height(entry.value, ratio);
    const bar = entry.low === null ? undefined : {
      type: "data", symmetric: false, thickness: 1.5, width: 4,
      array: [height(entry.high, ratio) - y], arrayminus: [y - height(entry.low, ratio)],
    };
    const look = looks(entry);
    const between = entry.low === null ? "" : `<br>95 %: ${shown(entry.low)} … ${shown(entry.high)}`;
    return {
      type: "scatter", mode: picked.has(entry) || usable.length <= NAMED ? "markers+text" : "markers", x: [entry.time], y: [y], error_y: bar,
      text: [escaped(label(entry))], textposition: place % 2 ? "bottom center" : "top center", cliponaxis: false,
      textfont: { size: picked.has(entry) ? 12 : 10.5, color: themed(picked.has(entry) ? "ink" : "quiet") },
      marker: {
        color: look.color, size: picked.has(entry) ? 13 : 9, symbol: entry.reference ? "diamond-open" : "circle",
        line: { color: entry.reference ? look.color : themed("card"), width: entry.reference ? 2 : 1 },
      },
      hovertemplate: `<b>${escaped(label(entry))}</b><br>${entry.quantity} ${shown(entry.value)}${between}` +
        `<br>${shown(entry.time)} µs a step<extra></extra>`,
      showlegend: false,
    };
  });
  const ticks = ratio ? costRatioTicks() : { exponentformat: "power", dtick: 1 };
  const quantity = ratio ? "cost ratio" : "total cost";
  Plotly.react("cost-time", points, layout({
    height: 440, margin: { l: 56, r: 24, t: 20, b: 44 }, hovermode: "closest",
    xaxis: axis({ type: "log", title: { text: "median time per step [µs]" }, dtick: "D2" }),
    yaxis: axis({ type: "log", title: { text: quantity }, ...ticks }),
  }), CONFIG);
  const missing = all.length - usable.length;
  element("cost-note").textContent =
    (ratio ? "The axis of the cost ratio is logarithmic in what it exceeds 1 by. " : "") +
    (missing ? `${missing} without a time or a finite cost ${missing === 1 ? "is" : "are"} not shown.` : "");
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
