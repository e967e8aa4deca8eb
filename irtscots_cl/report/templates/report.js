"use strict";
// Maps, light curves and camera frames of a measurement. Maps are [rows][columns], row 0 at the bottom, as the camera
// sees the mirror. Everything is in the element #data; nothing is fetched.

// Colours that all eyes tell apart: cividis for quantities, blue - white - orange about zero.
const SEQUENTIAL = [[0, 34, 78], [31, 53, 110], [72, 75, 108], [102, 97, 109], [130, 120, 116], [160, 144, 114],
  [191, 170, 104], [223, 198, 84], [254, 232, 56]];
const SIGNED = [[5, 48, 97], [33, 102, 172], [67, 147, 195], [146, 197, 222], [247, 247, 247], [253, 199, 140],
  [241, 150, 66], [200, 98, 17], [127, 59, 8]];
const EMPTY = [225, 225, 225];
const OUTLIERS = 0.005;  // share of the pixels that do not set the scale

const byId = (id) => document.getElementById(id);

async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const count = planes.length / 4, raw = new Uint8Array(planes.length);
  for (let k = 0; k < 4; k++) for (let n = 0; n < count; n++) raw[4 * n + k] = planes[k * count + n];
  return packed.type === "float32" ? new Float32Array(raw.buffer) : new Int32Array(raw.buffer);
}

function colour(table, share) {
  const at = Math.min(Math.max(share, 0), 1) * (table.length - 1), k = Math.min(Math.floor(at), table.length - 2);
  return table[k].map((low, c) => low + (at - k) * (table[k + 1][c] - low));
}

function digits(value, count = 5) {
  if (!Number.isFinite(value)) return "–";
  return Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? value.toExponential(count - 1)
    : String(Number(value.toPrecision(count)));
}

// The least-squares fit of the first `count` of 1, x, y, power, astigmatism (2), coma (2) over the used pixels, taken
// off the values; NaN elsewhere. With 0 terms the values of the used pixels as they are.
function withoutTerms(values, x, y, used, count) {
  const result = new Float32Array(values.length).fill(NaN), at = [];
  for (let n = 0; n < values.length; n++) if (used[n] && Number.isFinite(values[n])) at.push(n);
  if (count === 0 || at.length < count) { for (const n of at) result[n] = values[n]; return result; }
  let mx = 0, my = 0, size = 0;
  for (const n of at) { mx += x[n] / at.length; my += y[n] / at.length; }
  for (const n of at) size = Math.max(size, Math.abs(x[n] - mx), Math.abs(y[n] - my));
  const terms = (n) => {
    const u = (x[n] - mx) / size, v = (y[n] - my) / size, r2 = u * u + v * v;
    return [1, u, v, r2, u * u - v * v, u * v, u * r2, v * r2].slice(0, count);
  };
  const matrix = Array.from({ length: count }, () => new Array(count + 1).fill(0));
  for (const n of at) {
    const t = terms(n);
    for (let i = 0; i < count; i++) {
      for (let j = 0; j < count; j++) matrix[i][j] += t[i] * t[j];
      matrix[i][count] += t[i] * values[n];
    }
  }
  const fit = solved(matrix);
  for (const n of at) result[n] = values[n] - terms(n).reduce((sum, t, i) => sum + t * fit[i], 0);
  return result;
}

// The solution of a linear system [n][n + 1], by Gauss's elimination with pivots.
function solved(matrix) {
  const n = matrix.length;
  for (let i = 0; i < n; i++) {
    let p = i;
    for (let k = i; k < n; k++) if (Math.abs(matrix[k][i]) > Math.abs(matrix[p][i])) p = k;
    [matrix[i], matrix[p]] = [matrix[p], matrix[i]];
    for (let k = 0; k < n; k++) {
      if (k === i) continue;
      const factor = matrix[k][i] / matrix[i][i];
      for (let j = i; j <= n; j++) matrix[k][j] -= factor * matrix[i][j];
    }
  }
  return matrix.map((row, i) => row[n] / row[i]);
}

function statistics(values) {
  const known = [];
  for (const v of values) if (Number.isFinite(v)) known.push(v);
  if (!known.length) return { count: 0, rms: NaN, pv: NaN, low: NaN, high: NaN, lowest: NaN, highest: NaN };
  known.sort((a, b) => a - b);
  const share = (p) => known[Math.round(p * (known.length - 1))];
  const rms = Math.sqrt(known.reduce((sum, v) => sum + v * v, 0) / known.length);
  const lowest = known[0], highest = known[known.length - 1];
  return { count: known.length, rms, pv: highest - lowest, lowest, highest, low: share(OUTLIERS), high: share(1 - OUTLIERS) };
}

// Draws values on a canvas, each map pixel as a square of `zoom` canvas pixels; returns the zoom.
function paint(canvas, values, rows, columns, table, low, high) {
  const zoom = Math.max(1, Math.ceil(540 / Math.max(rows, columns))), small = document.createElement("canvas");
  small.width = columns; small.height = rows; canvas.width = zoom * columns; canvas.height = zoom * rows;
  const context = small.getContext("2d"), image = context.createImageData(columns, rows);
  for (let r = 0; r < rows; r++) for (let c = 0; c < columns; c++) {
    const v = values[(rows - 1 - r) * columns + c];
    const rgb = Number.isFinite(v) ? colour(table, (v - low) / ((high - low) || 1)) : EMPTY;
    image.data.set([...rgb, 255], 4 * (r * columns + c));
  }
  context.putImageData(image, 0, 0);
  const large = canvas.getContext("2d");
  large.imageSmoothingEnabled = false;
  large.drawImage(small, 0, 0, canvas.width, canvas.height);
  return zoom;
}

function paintBar(canvas, table, low, high, unit) {
  canvas.width = 560; canvas.height = 44;
  const context = canvas.getContext("2d");
  for (let k = 0; k < 540; k++) {
    context.fillStyle = `rgb(${colour(table, k / 539).map(Math.round).join(" ")})`;
    context.fillRect(10 + k, 2, 1, 16);
  }
  context.fillStyle = "#1c1c1c"; context.font = "14px system-ui, sans-serif";
  context.fillText(`${digits(low, 3)} ${unit}`, 10, 36);
  const end = `${digits(high, 3)} ${unit}`;
  context.fillText(end, 550 - context.measureText(end).width, 36);
  const middle = digits((low + high) / 2, 3);
  context.fillText(middle, 280 - context.measureText(middle).width / 2, 36);
}

// A curve with axes; points: [[x, y], ...]; mark: an x with a vertical line, or NaN.
function plot(canvas, points, xText, yText, mark = NaN) {
  canvas.width = 560; canvas.height = 260;
  const context = canvas.getContext("2d"), known = points.filter((p) => Number.isFinite(p[0] + p[1]));
  context.fillStyle = "#fff"; context.fillRect(0, 0, 560, 260);
  context.fillStyle = "#1c1c1c"; context.font = "13px system-ui, sans-serif";
  if (!known.length) { context.fillText("no samples", 240, 130); return; }
  const span = (k) => [Math.min(...known.map((p) => p[k])), Math.max(...known.map((p) => p[k]))];
  const [x0, x1] = span(0), [y0, y1] = span(1);
  const px = (x) => 70 + (x - x0) / ((x1 - x0) || 1) * 470, py = (y) => 210 - (y - y0) / ((y1 - y0) || 1) * 190;
  context.strokeStyle = "#1c1c1c"; context.strokeRect(70, 20, 470, 190);
  for (const [x, align] of [[x0, "left"], [x1, "right"]]) { context.textAlign = align; context.fillText(digits(x, 4), px(x), 228); }
  context.textAlign = "right";
  context.fillText(digits(y1, 3), 66, 30); context.fillText(digits(y0, 3), 66, 210);
  context.textAlign = "center"; context.fillText(xText, 305, 248);
  context.textAlign = "left"; context.fillText(yText, 74, 14);
  context.strokeStyle = context.fillStyle = "#0b5d83"; context.lineWidth = 1.5; context.beginPath();
  known.forEach((p, k) => (k ? context.lineTo(px(p[0]), py(p[1])) : context.moveTo(px(p[0]), py(p[1]))));
  context.stroke();
  if (known.length < 200) for (const p of known) { context.beginPath(); context.arc(px(p[0]), py(p[1]), 3, 0, 7); context.fill(); }
  if (mark >= x0 && mark <= x1) {
    context.strokeStyle = "#b45309"; context.beginPath(); context.moveTo(px(mark), 20); context.lineTo(px(mark), 210); context.stroke();
  }
}

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
    byId("maps").hidden = false;
    this.draw();
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
    this.mark(paint(byId("map"), this.values, this.rows, this.columns, table, low, high));
    paintBar(byId("bar"), table, low, high, layer.unit);
    const removed = layer.heights ? `, removed: ${byId("terms").selectedOptions[0].text}` : "";
    const waves = layer.unit === "nm" ? ` (${digits(s.rms / 632.8, 3)} waves of 632.8 nm)` : "";
    byId("statistics").textContent = `${layer.name}${removed}: rms ${digits(s.rms, 4)} ${layer.unit}${waves}, PV ${digits(s.pv, 4)} ${layer.unit}, ${s.count} pixels`;
    const every = this.maps.step > 1 ? ` Every ${this.maps.step}th row and column is shown.` : "";
    byId("caption").textContent = `${layer.name} [${layer.unit}], seen from the camera; the arrow points to the mirror's +x. Click a pixel for its numbers.${every}`;
    this.tell();
    this.profile();
  }

  // The fiducial, the chosen pixel and the profile line, over the map.
  mark(zoom) {
    const context = byId("map").getContext("2d"), size = zoom * Math.max(this.rows, this.columns) / 14;
    const [tx, ty] = this.maps.towards, x = 0.9 * size, y = zoom * this.rows - 0.9 * size;
    const tip = [x + tx * size / 2, y - ty * size / 2], tail = [x - tx * size / 2, y + ty * size / 2];
    context.lineWidth = 2; context.strokeStyle = context.fillStyle = "#000";
    context.beginPath(); context.moveTo(...tail); context.lineTo(...tip); context.stroke();
    context.beginPath(); context.moveTo(tip[0] + tx * 8, tip[1] - ty * 8);
    context.lineTo(tip[0] - ty * 5, tip[1] - tx * 5); context.lineTo(tip[0] + ty * 5, tip[1] + tx * 5); context.fill();
    context.font = "14px system-ui, sans-serif"; context.fillText("+x", tip[0] + tx * 12, tip[1] - ty * 12 + 5);
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
    this.line = this.line.length === 1 ? [this.line[0], [column, row]] : [[column, row]];
    if (this.line.length === 2) { this.drawing = false; byId("draw-line").setAttribute("aria-pressed", "false"); }
    this.draw();
  }

  key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: this.columns, ArrowDown: -this.columns }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    this.choose(Math.min(Math.max(this.chosen + step, 0), this.values.length - 1));
  }

  // Also tells a page around this one, such as a notebook.
  choose(n) {
    this.chosen = n;
    this.draw();
    const step = this.maps.step, row = step * Math.floor(n / this.columns), column = step * (n % this.columns);
    if (window.parent !== window) window.parent.postMessage({ chosen: [row, column] }, "*");
  }

  startLine() { this.drawing = !this.drawing; this.line = []; byId("draw-line").setAttribute("aria-pressed", String(this.drawing)); this.draw(); }

  // The numbers of the chosen pixel, and its light curves.
  tell() {
    const n = this.chosen, step = this.maps.step, row = step * Math.floor(n / this.columns), column = step * (n % this.columns);
    const rows = [["row, column", `${row}, ${column}`], ["mirror x, y", `${digits(this.x[n])}, ${digits(this.y[n])} mm`],
      ["flag", ["used", "empty", "clipped", "stray", "saturated", "masked"][this.flags[n]] ?? String(this.flags[n])]];
    this.maps.details.forEach((detail, k) => rows.push([detail.name, `${digits(this.details[k][n], 7)} ${detail.unit}`]));
    this.maps.layers.forEach((layer, k) => rows.push([layer.name, `${digits(this.layers[k][n], 6)} ${layer.unit}`]));
    rows.push(["shown, terms removed", `${digits(this.values[n], 6)} ${this.layer.unit}`]);
    byId("pixel").tBodies[0].replaceChildren(...rows.map(([name, text]) => {
      const line = document.createElement("tr"), head = document.createElement("th"), cell = document.createElement("td");
      head.scope = "row"; head.textContent = name; cell.textContent = text; line.append(head, cell);
      return line;
    }));
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
  constructor(maps, curves) {
    Object.assign(this, { maps, curves });
    curves.scans.forEach((scan, k) => byId("scan").add(new Option(`${scan.axis}: ${scan.places_mm.length} lines`, k)));
    byId("scan").addEventListener("change", () => this.start());
    byId("line").addEventListener("input", () => this.draw());
    byId("frames").hidden = false;
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
    byId("line-text").textContent = `line ${line + 1} of ${scan.places_mm.length}, at ${digits(scan.places_mm[line], 4)} mm`;
  }
}

async function main() {
  const { maps, curves } = JSON.parse(byId("data").textContent);
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
  if (curves) new FrameView(maps, curves);
  document.documentElement.dataset.ready = "yes";
  return view;
}

main();
