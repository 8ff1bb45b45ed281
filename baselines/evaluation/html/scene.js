// An arm in space: what Plotly draws of it.

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

// Where the scenes are seen from; a mouse or a finger turns them further.
const seenFrom = (x, y, z, up = { x: 0, y: 0, z: 1 }) =>
  ({ eye: { x, y, z }, up, center: { x: 0, y: 0, z: 0 }, projection: { type: "orthographic" } });
const VIEWS = {
  oblique: seenFrom(1, 1, 0.5), front: seenFrom(1.7, 0, 0), side: seenFrom(0, 1.7, 0),
  above: seenFrom(0, 0, 1.7, { x: 0, y: 1, z: 0 }),
};

const LIMITS = ["joint", "acceleration", "velocity", "stop"]; // colours of a joint, by what it is at
const GAP = [null, null, null];
const triples = (flat) => Array.from({ length: flat.length / 3 }, (_, k) => flat.slice(3 * k, 3 * k + 3));

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
    colours: states.map((state) => themed(LIMITS[state])), sizes: states.map((state) => (state ? 11 : 7)),
  };
}

// All traces of a scene, after so many rows.
function traces(scene, k) {
  const kind = WEBGL ? { type: "scatter3d" } : { type: "scatter" };
  const line = (name, points, look, rest) =>
    ({ ...kind, name, mode: "lines", hoverinfo: "skip", showlegend: false, line: look, ...placed(points), ...rest });
  const { at, colours, sizes } = moving(scene, k);
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
    dots("target", { color: themed("reference"), size: WEBGL ? 6 : 12, symbol: "circle-open", line: { width: 2 } }, at[4]),
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
    camera: PLAYER.camera,
  } });
}

