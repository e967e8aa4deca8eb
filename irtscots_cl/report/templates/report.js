// Maps, light curves and camera frames of a measurement, by the functions of maps.js.

const MOST_TOLD = 16;  // layers whose values are told of a pixel

class MapView {
  constructor(maps, parts, curves) {
    Object.assign(this, { maps, ...parts, curves });
    this.rows = Math.ceil(maps.rows / maps.step); this.columns = Math.ceil(maps.columns / maps.step);
    this.line = []; this.drawing = false;
    this.chosen = this.middle();
    maps.layers.forEach((layer, k) => byId("layer").add(new Option(layer.name, k)));
    for (const id of ["layer", "terms", "scale"]) byId(id).addEventListener("change", () => this.draw());
    byId("draw-line").addEventListener("click", () => this.startLine());
    const canvas = byId("map");
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("resize", () => this.draw());
    byId("maps").hidden = false;
    rulers(maps);
    this.draw();
  }

  // Row and column on the detector of a pixel of the maps.
  place(n) {
    const { step, first = [0, 0] } = this.maps;
    return [first[0] + step * Math.floor(n / this.columns), first[1] + step * (n % this.columns)];
  }

  // The used pixel nearest to the middle of the used ones.
  middle() {
    let row = 0, column = 0, count = 0, best = 0, least = Infinity;
    this.used.forEach((u, n) => { if (u) { row += Math.floor(n / this.columns); column += n % this.columns; count++; } });
    this.used.forEach((u, n) => {
      const d = (Math.floor(n / this.columns) - row / count) ** 2 + (n % this.columns - column / count) ** 2;
      if (u && d < least) { least = d; best = n; }
    });
    return best;
  }

  get layer() { return this.maps.layers[Number(byId("layer").value || 0)]; }

  // Values of a layer with the chosen terms removed from heights.
  valuesOf(k) {
    const layer = this.maps.layers[k], values = this.layers[k];
    return layer.heights ? withoutTerms(values, this.x, this.y, this.used, Number(byId("terms").value)) : values;
  }

  // The limits of the colours: those of all layers of the group, about zero for signed ones.
  limits() {
    const own = this.layer, wide = Number(byId("scale").value);
    const same = this.maps.layers.map((l, k) => k).filter((k) => this.maps.layers[k] === own || (own.group && this.maps.layers[k].group === own.group));
    const found = same.map((k) => statistics(this.valuesOf(k)));
    const low = Math.min(...found.map((s) => s.low)), high = Math.max(...found.map((s) => s.high));
    if (own.signed) { const most = wide > 0 ? wide : Math.max(Math.abs(low), Math.abs(high)) || 1; return [-most, most]; }
    return [low, wide > low ? wide : high];
  }

  draw() {
    const k = Number(byId("layer").value || 0), layer = this.maps.layers[k];
    this.values = this.valuesOf(k);
    byId("terms").disabled = !layer.heights;
    const [low, high] = this.limits(), table = layer.signed ? SIGNED : SEQUENTIAL, s = statistics(this.values);
    const zoom = paint(byId("map"), this.values, this.rows, this.columns, table, low, high);
    writeStatistics(byId("map"), s, layer.unit);
    this.mark(zoom);
    paintBar(byId("bar"), table, low, high, layer.unit);
    const removed = layer.heights ? `, removed: ${byId("terms").selectedOptions[0].text}` : "";
    const waves = layer.unit === "nm" ? ` (${digits(s.rms / 632.8, 3)} waves of 632.8 nm)` : "";
    byId("statistics").textContent = `${layer.name}${removed}: rms ${digits(s.rms, 4)} ${layer.unit}${waves}, PV ${digits(s.pv, 4)} ${layer.unit}, ${s.count} pixels`;
    const every = this.maps.step > 1 ? ` Of ${this.maps.step} rows and columns one is shown.` : "";
    byId("caption").textContent = `${layer.name} [${layer.unit}], seen from the camera; the arrow points to the mirror's +x. Click a pixel for its numbers, or move with the arrow keys.${every}`;
    this.tell();
    this.profile();
  }

  // The fiducial, the chosen pixel and the profile line, over the map.
  mark(zoom) {
    const context = byId("map").getContext("2d");
    markX(context, this.maps.towards, zoom, this.rows, this.columns);
    const middle = (column, row) => [zoom * (column + 0.5), zoom * (this.rows - 0.5 - row)];
    const [px, py] = middle(this.chosen % this.columns, Math.floor(this.chosen / this.columns)), half = Math.max(zoom / 2 + 2, 5);
    context.strokeRect(px - half, py - half, 2 * half, 2 * half);
    if (this.line.length) {
      context.beginPath();
      this.line.forEach((end, k) => (k ? context.lineTo(...middle(...end)) : context.moveTo(...middle(...end))));
      context.stroke();
      context.beginPath(); context.arc(...middle(...this.line[0]), 4, 0, 7); context.fill();
    }
  }

  at(event) {
    const box = byId("map").getBoundingClientRect();
    const column = Math.floor((event.clientX - box.left) / box.width * this.columns);
    const row = this.rows - 1 - Math.floor((event.clientY - box.top) / box.height * this.rows);
    return [Math.min(Math.max(column, 0), this.columns - 1), Math.min(Math.max(row, 0), this.rows - 1)];
  }

  press(event) {
    const [column, row] = this.at(event);
    if (!this.drawing) { this.choose(row * this.columns + column); return; }
    this.end([column, row]);
  }

  // One end of the profile line.
  end(place) {
    this.line = this.line.length === 1 ? [this.line[0], place] : [place];
    if (this.line.length === 2) { this.drawing = false; byId("draw-line").setAttribute("aria-pressed", "false"); }
    this.draw();
  }

  key(event) {
    if (this.drawing && event.key === "Enter") { this.end([this.chosen % this.columns, Math.floor(this.chosen / this.columns)]); return; }
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: this.columns, ArrowDown: -this.columns }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    const next = this.chosen + step, column = this.chosen % this.columns;
    if (next < 0 || next >= this.values.length || Math.abs(next % this.columns - column) > 1) return;  // at the edge
    this.choose(next);
  }

  // Also tells a page around this one, such as a notebook.
  choose(n) {
    this.chosen = n;
    this.draw();
    if (window.parent !== window) window.parent.postMessage({ chosen: this.place(n) }, "*");
  }

  // The ends are chosen by clicks, or with the arrow keys and Enter.
  startLine() { this.drawing = !this.drawing; this.line = []; byId("draw-line").setAttribute("aria-pressed", String(this.drawing)); this.draw(); }

  // The numbers of the chosen pixel, and its light curves.
  tell() {
    const n = this.chosen, [row, column] = this.place(n);
    const rows = [["row, column", `${row}, ${column}`], ["mirror x, y", `${millimetres(this.x[n])}, ${millimetres(this.y[n])} mm`],
      ["flag", ["used", "empty", "clipped", "stray", "saturated", "masked"][this.flags[n]] ?? String(this.flags[n])]];
    this.maps.details.forEach((detail, k) => rows.push([detail.name, `${digits(this.details[k][n], 7)} ${detail.unit}`]));
    const many = this.maps.layers.length > MOST_TOLD;  // then those alone that the shown one is one of
    this.maps.layers.forEach((layer, k) => (many && layer.group !== this.layer.group) || rows.push([layer.name, `${digits(this.layers[k][n], 6)} ${layer.unit}`]));
    rows.push(["shown, terms removed", `${digits(this.values[n], 6)} ${this.layer.unit}`]);
    byId("pixel").tBodies[0].replaceChildren(...rows.map(([name, text]) => {
      const line = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
      head.scope = "row"; head.textContent = name; cell.textContent = text; line.append(head, cell);
      return line;
    }));
    byId("pixel-said").textContent = `pixel ${row}, ${column}: ${this.layer.name} ${digits(this.values[n], 4)} ${this.layer.unit}`;
    if (this.curves) this.drawCurves(row, column);
  }

  drawCurves(row, column) {
    byId("curves").hidden = false;
    this.curves.scans.forEach((scan, k) => {
      const step = this.curves.step, r = Math.round(row / step) * step, c = Math.round(column / step) * step;
      const n = scan.index.get(r * this.maps.columns + c), centre = this.details[2 + k][this.chosen];
      const points = [];
      for (let w = 0; n !== undefined && w < scan.window; w++) {
        const line = scan.first[n] + w;
        if (line < scan.places_mm.length) points.push([scan.places_mm[line], scan.samples[n * scan.window + w]]);
      }
      plot(byId(`curve-${scan.axis}`), points, `line ${scan.axis} on the screen [mm]; the mark is the centroid`, `flux [${scan.unit}], pixel ${r}, ${c}`, centre);
    });
  }

  profile() {
    const canvas = byId("profile");
    canvas.hidden = this.line.length !== 2;
    if (canvas.hidden) return;
    const [[c0, r0], [c1, r1]] = this.line, count = Math.max(Math.abs(c1 - c0), Math.abs(r1 - r0), 1), points = [];
    const place = (n) => [this.x[n], this.y[n]];
    const start = place(r0 * this.columns + c0);
    for (let k = 0; k <= count; k++) {
      const n = Math.round(r0 + (r1 - r0) * k / count) * this.columns + Math.round(c0 + (c1 - c0) * k / count), [x, y] = place(n);
      points.push([Math.hypot(x - start[0], y - start[1]), this.values[n]]);
    }
    plot(canvas, points, "way along the line on the mirror [mm]", `${this.layer.name} [${this.layer.unit}]`);
  }
}

class FrameView {
  constructor(map, setup) {
    Object.assign(this, { map, setup, maps: map.maps, curves: map.curves });
    const { curves } = map;
    curves.scans.forEach((scan, k) => byId("scan").add(new Option(`${scan.axis}: ${scan.places_mm.length} lines`, k)));
    byId("scan").addEventListener("change", () => this.start());
    byId("line").addEventListener("input", () => this.draw());
    for (const id of ["frames", "frame-controls", "line-caption"]) byId(id).hidden = false;
    byId("setup-title").textContent = "Set-up and camera frames";
    window.addEventListener("resize", () => this.draw());
    this.start();
  }

  get scan() { return this.curves.scans[Number(byId("scan").value || 0)]; }

  // The slider over the lines that light something, at the brightest; one scale for all frames.
  start() {
    const scan = this.scan, light = new Float64Array(scan.places_mm.length);
    this.most = 0;
    scan.samples.forEach((v, k) => {
      const line = scan.first[Math.floor(k / scan.window)] + k % scan.window;
      if (line < light.length && Number.isFinite(v)) { light[line] += v; this.most = Math.max(this.most, v); }
    });
    const most = Math.max(...light), lit = [...light.keys()].filter((k) => light[k] > 0.01 * most);
    Object.assign(byId("line"), { min: lit[0] ?? 0, max: lit[lit.length - 1] ?? 0 });
    byId("line").value = light.indexOf(most);
    this.draw();
  }

  draw() {
    const scan = this.scan, line = Number(byId("line").value), step = this.curves.step;
    const rows = Math.ceil(this.maps.rows / step), columns = Math.ceil(this.maps.columns / step);
    const values = new Float32Array(rows * columns);
    scan.pixels.forEach((pixel, n) => {
      const w = line - scan.first[n];
      if (w >= 0 && w < scan.window) values[Math.floor(pixel / this.maps.columns) / step * columns + pixel % this.maps.columns / step] = scan.samples[n * scan.window + w];
    });
    paint(byId("frame"), values, rows, columns, SEQUENTIAL, 0, this.most);
    paintBar(byId("frame-bar"), SEQUENTIAL, 0, this.most, scan.unit);
    this.setup.show({ axis: scan.axis, place: scan.places_mm[line], rays: this.rays(scan, line) });
    byId("line-text").textContent = `line ${line + 1} of ${scan.places_mm.length}, at ${digits(scan.places_mm[line], 4)} mm`;
  }

  // The light of a line, spread over the pixels that it lights: [u, v] on the screen, x, y, z on the mirror. The other
  // coordinate on the screen is the pixel's centroid.
  rays(scan, line) {
    const { map } = this, k = map.curves.scans.indexOf(scan), step = map.maps.step, height = map.maps.layers.findIndex((l) => l.unit === "mm");
    const lit = [];
    scan.pixels.forEach((pixel, n) => {
      const w = line - scan.first[n], m = Math.round(Math.floor(pixel / map.maps.columns) / step) * map.columns + Math.round(pixel % map.maps.columns / step);
      const flux = w >= 0 && w < scan.window ? scan.samples[n * scan.window + w] : 0, z = map.layers[height][m], other = map.details[3 - k][m];
      if (flux > 0.5 * this.most && map.used[m] && Number.isFinite(z + other)) lit.push([...(k ? [other, scan.places_mm[line]] : [scan.places_mm[line], other]), map.x[m], map.y[m], z]);
    });
    lit.sort((a, b) => a[1 - k] - b[1 - k]);
    const count = Math.min(LINE_RAYS, lit.length);
    return Array.from({ length: count }, (_, i) => lit[count > 1 ? Math.round(i * (lit.length - 1) / (count - 1)) : 0]);
  }
}

async function main() {
  const { maps, curves, setup } = JSON.parse(byId("data").textContent);
  const drawing = new SetupView(setup);
  if (!maps) { document.documentElement.dataset.ready = "yes"; return null; }
  const parts = {};
  for (const name of ["x", "y", "used", "flags"]) parts[name] = await unpack(maps[name]);
  parts.details = await Promise.all(maps.details.map((detail) => unpack(detail.map)));
  parts.layers = await Promise.all(maps.layers.map((layer) => unpack(layer.map)));
  for (const scan of curves ? curves.scans : []) {
    scan.window = scan.samples.shape[1];
    for (const name of ["pixels", "first", "samples"]) scan[name] = await unpack(scan[name]);
    scan.index = new Map(Array.from(scan.pixels, (pixel, n) => [pixel, n]));
  }
  const view = new MapView(maps, parts, curves);
  if (curves) new FrameView(view, drawing);
  document.documentElement.dataset.ready = "yes";
  return view;
}

main();
