// Sorting and filtering of the table, the choice of policies, and the table of episodes.

const LINES = [...document.querySelectorAll("#results tbody tr")];
// Most episodes in the table of episodes.
const MOST_EPISODES = 500;

// Numbers by value, texts by letters; what is missing stands below, whatever the direction.
function compared(a, b, direction) {
  if (a === "" || b === "") return (a === "") - (b === "");
  const numbers = [Number(a), Number(b)];
  const order = numbers.some(Number.isNaN) ? a.localeCompare(b) : numbers[0] - numbers[1];
  return direction * order;
}

function sortBy(head) {
  const direction = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  for (const other of head.parentElement.children) if (other.ariaSort) other.setAttribute("aria-sort", "none");
  head.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
  const value = (line) => line.children[head.cellIndex].dataset.value;
  const sorted = [...LINES].sort((a, b) => compared(value(a), value(b), direction));
  document.querySelector("#results tbody").append(...sorted);
}

// Lines that have all words of the filter, of the scenario that is chosen.
function filterLines() {
  const words = element("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  const scenario = element("scenario").value;
  let count = 0;
  for (const line of LINES) {
    const text = line.textContent.toLowerCase();
    line.hidden = (scenario && line.dataset.scenario !== scenario) || !words.every((word) => text.includes(word));
    count += !line.hidden;
  }
  element("count").textContent = `${count} of ${LINES.length}`;
}

const entryOf = (line) => DATA.entries[Number(line.dataset.entry)];
const boxOf = (line) => line.querySelector("input");

// The entries that are ticked; all are of one scenario.
const chosen = () => LINES.map((line) => (boxOf(line).checked ? entryOf(line) : null)).filter(Boolean)
  .sort((a, b) => DATA.entries.indexOf(a) - DATA.entries.indexOf(b));

// Policies of another scenario follow another path: their ticks go.
function choose(line) {
  for (const other of LINES) if (other.dataset.scenario !== line.dataset.scenario) boxOf(other).checked = false;
  swatches();
}

// The colours that the chosen ones have in the pictures.
function swatches() {
  for (const line of LINES) {
    const box = boxOf(line);
    box.style.setProperty("--swatch", box.checked ? looks(entryOf(line)).color : "transparent");
  }
}

// The cheapest three of a scenario, without those that know more than the others if there are enough.
function chooseBest(scenario) {
  const cost = (line) => entryOf(line).value ?? Infinity;
  const lines = LINES.filter((line) => line.dataset.scenario === scenario && entryOf(line).series);
  const rank = (line) => (entryOf(line).reference ? 1 : 0);
  const best = lines.sort((a, b) => rank(a) - rank(b) || cost(a) - cost(b)).slice(0, 3);
  for (const line of LINES) boxOf(line).checked = best.includes(line);
  swatches();
}

// The rows of results.json.
function rows() {
  const names = Object.keys(DATA.rows);
  const cells = names.map((name) => {
    const column = DATA.rows[name];
    return Array.isArray(column) ? column : column.index.map((place) => column.distinct[place]);
  });
  return (cells[0] ?? []).map((_, k) => Object.fromEntries(names.map((name, j) => [name, cells[j][k]])));
}

const EPISODE_COLUMNS = {
  policy: 1, scenario: 1, seed: 1, cost_ratio: 1, total_cost: 1, position_error_max: 1e3, orientation_error_max: 1e3,
  time_p50_us: 1, time_p99_us: 1, status: 1,
};
const UNITS = { position_error_max: " [mm]", orientation_error_max: " [mrad]", time_p50_us: "", time_p99_us: "" };

function showEpisodes() {
  const table = document.querySelector("#episodes table");
  if (!element("episodes").open) return;
  const scenario = element("scenario").value;
  const all = rows().filter((one) => !scenario || one.scenario === scenario);
  const line = (cells, kind) => {
    const out = document.createElement("tr");
    for (const cell of cells) {
      const made = document.createElement(kind);
      made.textContent = cell;
      out.append(made);
    }
    return out;
  };
  const cell = (one, name) => (typeof one[name] === "string" ? one[name]
    : one[name] === null ? "–" : name === "seed" ? `${one[name]}` : shown(one[name] * EPISODE_COLUMNS[name]));
  const names = Object.keys(EPISODE_COLUMNS);
  const head = names.map((name) => name.replace("_us", " [µs]").replaceAll("_", " ") + (UNITS[name] ?? ""));
  const body = all.slice(0, MOST_EPISODES).map((one) => line(names.map((name) => cell(one, name)), "td"));
  table.replaceChildren(line(head, "th"), ...body);
  const rest = all.length > MOST_EPISODES ? `The first ${MOST_EPISODES} of ${all.length}; all are in results.csv.` : "";
  element("episodes-note").textContent = rest;
}

function prepareTable(changed) {
  const scenarios = [...new Set(LINES.map((line) => line.dataset.scenario))];
  const select = element("scenario");
  element("results").classList.toggle("single", scenarios.length === 1);
  if (scenarios.length !== 1) select.add(new Option("all", ""));
  for (const name of scenarios) select.add(new Option(name, name));
  for (const head of document.querySelectorAll("#results thead th[aria-sort]")) {
    head.firstElementChild.addEventListener("click", () => sortBy(head));
  }
  element("filter").addEventListener("input", filterLines);
  select.addEventListener("change", () => {
    filterLines();
    showEpisodes();
    chooseBest(select.value || scenarios[0]);
    changed();
  });
  element("episodes").addEventListener("toggle", showEpisodes);
  for (const line of LINES) {
    boxOf(line).addEventListener("change", () => {
      choose(line);
      changed();
    });
  }
  filterLines();
  chooseBest(scenarios[0]);
}
