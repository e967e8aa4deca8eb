"use strict";
// What the pages share: arrays, colours, maps and curves on canvases. Maps are [rows][columns], row 0 at the bottom, as
// the camera sees the mirror. Everything is in the element #data; nothing is fetched.

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
  return minus(Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? value.toExponential(count - 1)
    : String(Number(value.toPrecision(count))));
}

// A number's text with the signs of print.
function minus(text) { return text.replaceAll("-", "−"); }

// To a micrometre, without -0.
function millimetres(value) { return Number.isFinite(value) ? minus((Math.round(value * 1000) / 1000 + 0).toFixed(3)) : "–"; }

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

// A canvas's context in CSS pixels, as wide as its place, so that letters keep their size on phones.
function sized(canvas, most, high) {
  const wide = Math.min(most, canvas.parentElement.clientWidth || most), ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(wide * ratio); canvas.height = Math.round(high * ratio);
  canvas.style.width = `${wide}px`;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  return [context, wide];
}

// Of a canvas that its style stretches: how many of its own pixels a CSS pixel has.
function stretch(canvas) { return canvas.clientWidth ? canvas.width / canvas.clientWidth : 1; }

function paintBar(canvas, table, low, high, unit) {
  const above = byId(canvas.id === "bar" ? "map" : "frame");  // its ends are below the picture's
  const [context, wide] = sized(canvas, (above.clientWidth || 524) + 20, 44), inner = wide - 20;
  for (let k = 0; k < inner; k++) {
    context.fillStyle = `rgb(${colour(table, k / (inner - 1)).map(Math.round).join(" ")})`;
    context.fillRect(10 + k, 2, 1.5, 16);
  }
  context.fillStyle = "#1c1c1c"; context.font = "14px system-ui, sans-serif";
  context.fillText(`${digits(low, 3)} ${unit}`, 10, 36);
  const end = `${digits(high, 3)} ${unit}`;
  context.fillText(end, wide - 10 - context.measureText(end).width, 36);
  const middle = digits((low + high) / 2, 3);
  context.fillText(middle, wide / 2 - context.measureText(middle).width / 2, 36);
}

// Numbers along the four sides of the map: the mirror's millimetres below and on the left, the detector's pixels above
// and on the right. mm: { x: [at the left edge, at the right edge], y: [bottom, top] }, or null where the grid is turned.
function rulers({ rows, columns, mm }) {
  const side = (id, low, high, across, name) => {
    const ruler = byId(id), all = [], bold = document.createElement("b");
    for (const value of nice(low, high)) {
      const share = 100 * (value - low) / (high - low), span = document.createElement("span");
      span.textContent = minus(String(value));
      if (across) span.style.cssText = `left: ${share}%; transform: translateX(-50%); ${id === "map-top" ? "bottom" : "top"}: 0`;
      else span.style.cssText = `bottom: ${share}%; transform: translateY(50%); ${id === "map-left" ? "right" : "left"}: .25rem`;
      all.push(span);
    }
    bold.textContent = name;
    bold.style.cssText = { "map-top": "left: -2.2rem; bottom: 0", "map-bottom": "right: -2rem; top: 0", "map-left": "right: .2rem; bottom: -1.2rem", "map-right": "left: .2rem; top: -1.2rem" }[id];
    ruler.replaceChildren(...all, bold);
  };
  side("map-top", -0.5, columns - 0.5, true, "col");
  side("map-right", -0.5, rows - 0.5, false, "row");
  if (mm) { side("map-bottom", ...mm.x, true, "mm"); side("map-left", ...mm.y, false, "mm"); }
  else for (const id of ["map-bottom", "map-left"]) byId(id).replaceChildren();
}

// Up to six round numbers between two.
function nice(low, high) {
  const rough = Math.abs(high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) ?? 10), all = [];
  const [from, to] = low < high ? [low, high] : [high, low];
  for (let k = Math.ceil(from / step); k * step <= to; k++) all.push(Number((k * step).toPrecision(6)));
  return all;
}

// The fiducial of a map: an arrow to the mirror's +x, [columns, rows] of the camera, in the lower left corner.
function markX(context, [tx, ty], zoom, rows, columns) {
  const size = zoom * Math.max(rows, columns) / 14, x = 0.9 * size, y = zoom * rows - 0.9 * size, unit = stretch(context.canvas);
  const tip = [x + tx * size / 2, y - ty * size / 2], tail = [x - tx * size / 2, y + ty * size / 2];
  context.lineWidth = 2; context.strokeStyle = context.fillStyle = "#000";
  context.beginPath(); context.moveTo(...tail); context.lineTo(...tip); context.stroke();
  context.beginPath(); context.moveTo(tip[0] + tx * 8, tip[1] - ty * 8);
  context.lineTo(tip[0] - ty * 5, tip[1] - tx * 5); context.lineTo(tip[0] + ty * 5, tip[1] + tx * 5); context.fill();
  context.font = `${14 * unit}px system-ui, sans-serif`; context.fillText("+x", tip[0] + tx * 8 * unit, tip[1] - ty * 8 * unit + 5);
}

// rms and PV in the upper left corner of a map.
function writeStatistics(canvas, s, unit) {
  const context = canvas.getContext("2d"), size = 13 * stretch(canvas);
  context.font = `${size}px system-ui, sans-serif`; context.fillStyle = "#000"; context.strokeStyle = "#fff"; context.lineWidth = size / 4;
  [`rms ${digits(s.rms, 3)} ${unit}`, `PV ${digits(s.pv, 3)} ${unit}`].forEach((text, k) => {
    context.strokeText(text, size / 2, size * (1.3 + 1.25 * k)); context.fillText(text, size / 2, size * (1.3 + 1.25 * k));
  });
}

// A curve with axes; points: [[x, y], ...]; mark: an x with a vertical line, or NaN.
function plot(canvas, points, xText, yText, mark = NaN) {
  const [context, wide] = sized(canvas, 560, 260), known = points.filter((p) => Number.isFinite(p[0] + p[1])), right = wide - 20;
  context.fillStyle = "#fff"; context.fillRect(0, 0, wide, 260);
  context.fillStyle = "#1c1c1c"; context.font = "13px system-ui, sans-serif";
  if (!known.length) { context.textAlign = "center"; context.fillText("no samples", wide / 2, 130); return; }
  const span = (k) => [Math.min(...known.map((p) => p[k])), Math.max(...known.map((p) => p[k]))];
  const [x0, x1] = span(0), [y0, y1] = span(1);
  const px = (x) => 70 + (x - x0) / ((x1 - x0) || 1) * (right - 70), py = (y) => 210 - (y - y0) / ((y1 - y0) || 1) * 190;
  context.strokeStyle = "#1c1c1c"; context.strokeRect(70, 20, right - 70, 190);
  for (const [x, align] of [[x0, "left"], [x1, "right"]]) { context.textAlign = align; context.fillText(digits(x, 4), px(x), 228); }
  context.textAlign = "right";
  context.fillText(digits(y1, 3), 66, 30); context.fillText(digits(y0, 3), 66, 210);
  context.textAlign = "center"; context.fillText(xText, (70 + right) / 2, 248, right - 70);
  context.textAlign = "left"; context.fillText(yText, 74, 14);
  context.strokeStyle = context.fillStyle = "#0b5d83"; context.lineWidth = 1.5; context.beginPath();
  known.forEach((p, k) => (k ? context.lineTo(px(p[0]), py(p[1])) : context.moveTo(px(p[0]), py(p[1]))));
  context.stroke();
  if (known.length < 200) for (const p of known) { context.beginPath(); context.arc(px(p[0]), py(p[1]), 3, 0, 7); context.fill(); }
  if (mark >= x0 && mark <= x1) {
    context.strokeStyle = "#b45309"; context.beginPath(); context.moveTo(px(mark), 20); context.lineTo(px(mark), 210); context.stroke();
  }
}
