// Runs side by side, by the functions of maps.js: the map of one, the difference of two, or two in turn.

const BLINK_MS = 700;

class RunsView {
  constructor(runs) {
    this.runs = runs; this.chosen = null; this.turn = 0;
    for (const id of ["first", "second"]) runs.forEach((run, k) => byId(id).add(new Option(run.name, k)));
    byId("second").value = String(Math.min(1, runs.length - 1));
    runs[0].layers.forEach((layer, k) => byId("layer").add(new Option(layer.name, k)));
    if (runs.length > 1) byId("show").value = "difference";
    for (const id of ["first", "second", "show", "layer", "terms"]) byId(id).addEventListener("change", () => this.start());
    byId("map").addEventListener("pointerdown", (event) => this.press(event));
    byId("map").addEventListener("keydown", (event) => this.key(event));
    this.start();
  }

  get pair() { return ["first", "second"].map((id) => this.runs[Number(byId(id).value)]); }
  get layer() { return Number(byId("layer").value); }

  start() {
    clearInterval(this.timer);
    this.turn = 0;
    if (byId("show").value === "blink") this.timer = setInterval(() => { this.turn = 1 - this.turn; this.draw(); }, BLINK_MS);
    this.draw();
  }

  // A run's values, low-order terms taken off heights over the pixels used.
  valuesOf(run, values = run.values[this.layer], used = run.used) {
    const terms = run.layers[this.layer].heights ? Number(byId("terms").value) : 0;
    return withoutTerms(values, run.x, run.y, used, terms);
  }

  difference(a, b) {
    if (a.rows !== b.rows || a.columns !== b.columns) return null;
    const used = a.used.map((u, n) => u && b.used[n]);
    return this.valuesOf(a, a.values[this.layer].map((v, n) => v - b.values[this.layer][n]), used);
  }

  draw() {
    const [a, b] = this.pair, show = byId("show").value, layer = a.layers[this.layer];
    byId("terms").disabled = !layer.heights;
    this.run = show === "second" || (show === "blink" && this.turn) ? b : a;
    this.size = [Math.ceil(this.run.rows / this.run.step), Math.ceil(this.run.columns / this.run.step)];
    const values = show === "difference" ? this.difference(a, b) : this.valuesOf(this.run);
    const said = { first: `A: ${a.name}`, second: `B: ${b.name}`, difference: `A − B: ${a.name} − ${b.name}`,
      blink: this.turn ? `B: ${b.name}` : `A: ${a.name}` }[show];
    if (values === null) {
      byId("statistics").textContent = `${said}: of ${a.rows} x ${a.columns} and ${b.rows} x ${b.columns} pixels, which have no difference`;
      paint(byId("map"), new Float32Array(1).fill(NaN), 1, 1, SIGNED, -1, 1);
      return;
    }
    // A, B and both in turn on one scale; a difference on its own, about zero
    const scaled = (show === "difference" ? [values] : [a, b].map((run) => this.valuesOf(run))).map(statistics);
    let low = Math.min(...scaled.map((s) => s.low)), high = Math.max(...scaled.map((s) => s.high));
    const signed = layer.signed || show === "difference", table = signed ? SIGNED : SEQUENTIAL, s = statistics(values);
    if (signed) { high = Math.max(Math.abs(low), Math.abs(high)) || 1; low = -high; }
    const zoom = paint(byId("map"), values, ...this.size, table, low, high);
    rulers(this.run);
    writeStatistics(byId("map"), s, layer.unit);
    this.mark(zoom);
    paintBar(byId("bar"), table, low, high, layer.unit);
    const removed = layer.heights ? `, removed: ${byId("terms").selectedOptions[0].text}` : "";
    byId("statistics").textContent = `${said}: ${layer.name}${removed}: rms ${digits(s.rms, 4)} ${layer.unit}, PV ${digits(s.pv, 4)} ${layer.unit}, ${s.count} pixels`;
    byId("caption").textContent = `${layer.name} [${layer.unit}], seen from the camera; the arrow points to the mirror's +x. Click a pixel for the numbers of all runs.`;
    this.tell();
  }

  mark(zoom) {
    const context = byId("map").getContext("2d");
    markX(context, this.run.towards, zoom, ...this.size);
    if (this.chosen === null) return;
    const [row, column] = this.chosen, half = Math.max(zoom / 2 + 2, 5);
    context.strokeRect(zoom * (column + 0.5) - half, zoom * (this.size[0] - 0.5 - row) - half, 2 * half, 2 * half);
  }

  press(event) {
    const box = byId("map").getBoundingClientRect(), [rows, columns] = this.size;
    this.choose(rows - 1 - Math.floor((event.clientY - box.top) / box.height * rows),
      Math.floor((event.clientX - box.left) / box.width * columns));
  }

  key(event) {
    const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, 0], ArrowDown: [-1, 0] }[event.key];
    if (!step) return;
    event.preventDefault();
    const [row, column] = this.chosen ?? this.size.map((n) => Math.floor(n / 2));
    this.choose(row + step[0], column + step[1]);
  }

  choose(row, column) {
    this.chosen = [[row, this.size[0]], [column, this.size[1]]].map(([n, count]) => Math.min(Math.max(n, 0), count - 1));
    this.draw();
  }

  tell() {
    if (this.chosen === null) return;
    const [row, column] = this.chosen, k = this.layer, unit = this.run.layers[k].unit, step = this.run.step;
    const rows = [["row, column", `${row * step}, ${column * step}`]];
    for (const run of this.runs) {
      const inside = row < Math.ceil(run.rows / run.step) && column < Math.ceil(run.columns / run.step);
      const n = row * Math.ceil(run.columns / run.step) + column;
      rows.push([run.name, inside ? `${digits(run.values[k][n], 6)} ${unit}` : "–"]);
    }
    byId("pixel").tBodies[0].replaceChildren(...rows.map(([name, text]) => {
      const line = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
      head.scope = "row"; head.textContent = name; cell.textContent = text; line.append(head, cell);
      return line;
    }));
  }
}

async function main() {
  const { runs } = JSON.parse(byId("data").textContent);
  for (const run of runs) {
    for (const name of ["x", "y", "used"]) run[name] = await unpack(run[name]);
    run.values = await Promise.all(run.layers.map((layer) => unpack(layer.map)));
  }
  new RunsView(runs);
  document.documentElement.dataset.ready = "yes";
}

main();
