// Costs against times, and errors over time.

const NEAREST = 1e-4; // by how much a cost ratio exceeds 1 at the lower end of its axis at most
const SMALLEST = 1e-10; // errors below are rounding, in [m] and [rad]

// The scenario whose policies are compared: that of the pictures.
const current = () => chosen()[0]?.scenario ?? (element("scenario").value || DATA.entries[0]?.scenario);

// The axis of a cost ratio is logarithmic in what it exceeds 1 by.
const height = (value, ratio) => (ratio ? Math.max(value - 1, NEAREST) : Math.max(value, 1e-12));

function drawCostTime() {
  const all = DATA.entries.filter((entry) => entry.scenario === current());
  const ratio = all.every((entry) => entry.quantity === "cost ratio");
  const usable = all.filter((e) => e.time !== null && e.value !== null && (ratio || e.quantity === "total cost"));
  const picked = new Set(chosen());
  const points = usable.map((entry) => {
    const y = height(entry.value, ratio);
    const bar = entry.low === null ? undefined : {
      type: "data", symmetric: false, thickness: 1.5, width: 4,
      array: [height(entry.high, ratio) - y], arrayminus: [y - height(entry.low, ratio)],
    };
    const look = looks(entry);
    const between = entry.low === null ? "" : `<br>95 %: ${shown(entry.low)} … ${shown(entry.high)}`;
    return {
      type: "scatter", mode: "markers+text", x: [entry.time], y: [y], error_y: bar,
      text: [escaped(label(entry))], textposition: "top center", textfont: { size: 11 }, cliponaxis: false,
      marker: {
        color: look.color, size: picked.has(entry) ? 13 : 9, symbol: entry.reference ? "diamond-open" : "circle",
        line: { color: entry.reference ? look.color : themed("card"), width: entry.reference ? 2 : 1 },
      },
      hovertemplate: `<b>${escaped(label(entry))}</b><br>${entry.quantity} ${shown(entry.value)}${between}` +
        `<br>${shown(entry.time)} µs a step<extra></extra>`,
      showlegend: false,
    };
  });
  const powers = Array.from({ length: 13 }, (_, k) => k - 4);
  const ticks = ratio ? { tickvals: powers.map((k) => 10 ** k), ticktext: powers.map((k) => shown(1 + 10 ** k)) } : {};
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

// Line `width` steps wide for each chosen policy; a panel and its axes say where.
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
    axes[`yaxis${place}`] = axis({ type: "log", title: { text: kinds[kind] }, exponentformat: "power" });
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
