"use strict";
// What Python has written into the page, and small things that all other scripts use.

const DATA = JSON.parse(document.getElementById("data").textContent);
// Okabe and Ito's colours, without those that are lost on white or on black.
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#a0622d", "#8a8f98"];
const DASHES = ["solid", "dash", "dot"];

const element = (id) => document.getElementById(id);

// The value of a colour of the style sheet, which knows whether the page is light or dark.
const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// Plotly reads texts as HTML; names are none.
const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

// Lets the browser show what was drawn, and heed the reader.
const painted = () => new Promise((resolve) => { setTimeout(resolve); });

const label = (entry) => entry.policy + (entry.reference ? " *" : "");

// A number with four significant digits.
function shown(value) {
  if (value === null || Number.isNaN(value)) return "–";
  const digits = Number(value.toPrecision(4));
  return digits !== 0 && (Math.abs(digits) < 1e-3 || Math.abs(digits) >= 1e5) ? digits.toExponential() : `${digits}`;
}

// Colour and dashes of a policy: its own if it is one of those that are chosen, else a pale one.
function looks(entry) {
  const place = chosen().indexOf(entry);
  if (place < 0) return { color: themed("links"), dash: "solid" };
  return { color: COLOURS[place % COLOURS.length], dash: DASHES[Math.floor(place / COLOURS.length) % DASHES.length] };
}

// An array of the series of an entry, decoded when it is first asked for; undefined where there is none.
function array(entry, name) {
  const given = entry.series.arrays[name];
  if (given === undefined || given.values) return given;
  const bytes = Uint8Array.from(atob(given.data), (sign) => sign.charCodeAt(0));
  given.values = given.type === "f4" ? new Float32Array(bytes.buffer) : bytes;
  given.width = given.shape.slice(1).reduce((product, size) => product * size, 1);
  delete given.data;
  return given;
}

// A row of an array, or a column of it from the first row to one before `end`.
const row = (from, k) => Array.from(from.values.subarray(k * from.width, (k + 1) * from.width));
function column(from, j, end = from.shape[0]) {
  return Array.from({ length: end }, (_, k) => from.values[k * from.width + j]);
}

// What all plots look like.
function layout(changes) {
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: themed("ink") },
    hoverlabel: { bgcolor: themed("card"), font: { color: themed("ink") } },
    ...changes,
  };
}
const axis = (changes) => ({
  gridcolor: themed("line"), zerolinecolor: themed("line"), linecolor: themed("quiet"), automargin: true, ...changes,
});
const CONFIG = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };
