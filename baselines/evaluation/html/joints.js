// The motion of each joint over time, with its limits.

const NEAR = 0.5; // limits further off than this share of what is seen stay out of sight
const EDGE = 0.04; // how much is seen beyond a limit

// Lower and upper limit of a joint's coordinate, velocity or acceleration; null for none.
function bounds(series, quantity, joint) {
  if (quantity === "q") return [series.lower[joint], series.upper[joint]];
  const limit = (quantity === "qdot" ? series.velocity_limit : series.acceleration_limit)?.[joint] ?? null;
  return [limit === null ? null : -limit, limit];
}

// What is seen of an axis, and the bands beyond the limits that are near.
function view(values, limits, place) {
  const finite = values.filter(Number.isFinite);
  let [low, high] = finite.length ? [Math.min(...finite), Math.max(...finite)] : [-1, 1];
  const margin = Math.max(0.05 * (high - low), 1e-6 * Math.max(Math.abs(low), Math.abs(high)), 1e-9);
  [low, high] = [low - margin, high + margin];
  const span = high - low;
  const below = limits[0] !== null && limits[0] > low - NEAR * span;
  const above = limits[1] !== null && limits[1] < high + NEAR * span;
  const range = [
    below ? Math.min(low, limits[0] - EDGE * span) : low, above ? Math.max(high, limits[1] + EDGE * span) : high,
  ];
  const band = (y0, y1) => ({
    type: "rect", xref: `x${place} domain`, yref: `y${place}`, x0: 0, x1: 1, y0, y1, layer: "below",
    fillcolor: themed("beyond"), line: { width: 0 },
  });
  return { range, bands: [...(below ? [band(range[0], limits[0])] : []), ...(above ? [band(limits[1], range[1])] : [])] };
}

function drawJoints() {
  const quantity = element("quantity").value;
  const entries = withSeries().filter((entry) => entry.series.arrays[quantity]);
  const joints = entries.length ? entries[0].series.prismatic.length : 0;
  const columns = element("joints").clientWidth > 720 && joints > 3 ? 2 : 1;
  const lines = Math.ceil(joints / columns);
  const suffix = { q: "", qdot: "/s", qddot: "/s²" }[quantity];
  const symbol = { q: "q", qdot: "q̇", qddot: "q̈" }[quantity];
  const traces = [];
  const axes = {};
  const shapes = [];
  for (let joint = 0; joint < joints; joint += 1) {
    const place = joint === 0 ? "" : `${joint + 1}`;
    const seen = [];
    for (const entry of entries) {
      const values = column(array(entry, quantity), joint);
      seen.push(...values);
      traces.push(curve(entry, column(array(entry, "time"), 0), values, place, { showlegend: joint === 0 }));
    }
    const { range, bands } = view(seen, bounds(entries[0].series, quantity, joint), place);
    shapes.push(...bands);
    const unit = (entries[0].series.prismatic[joint] ? "m" : "rad") + suffix;
    axes[`yaxis${place}`] = axis({ range, title: { text: `${symbol}<sub>${joint + 1}</sub> [${unit}]`, standoff: 4 } });
    axes[`xaxis${place}`] = axis({
      matches: joint ? "x" : undefined, title: { text: joint >= (lines - 1) * columns ? "time [s]" : "" },
    });
  }
  Plotly.react("joints", traces, layout({
    height: 170 * Math.max(lines, 1) + 70, margin: { l: 62, r: 16, t: 10, b: 44 },
    grid: { rows: Math.max(lines, 1), columns, pattern: "independent", ygap: 0.3, xgap: 0.14 },
    legend: { orientation: "h", y: 1.01, yanchor: "bottom" }, shapes, ...axes,
  }), CONFIG);
}
