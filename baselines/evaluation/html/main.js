// The table works at once; Plotly, which is large, is read when it has been painted.

async function drawAll() {
  for (const draw of [drawCostTime, drawErrors, drawJoints, drawReplay]) {
    await draw();
    await painted();
  }
}

async function begin() {
  const library = document.createElement("script");
  library.textContent = element("plotly").textContent;
  document.head.append(library);
  preparePlayer();
  element("quantity").addEventListener("change", drawJoints);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
  await drawAll();
  document.documentElement.dataset.ready = "yes";
}

prepareTable(() => globalThis.Plotly && drawAll());
requestAnimationFrame(() => setTimeout(begin));
