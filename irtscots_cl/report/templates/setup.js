// The set-up to scale: from the side (z, x), from the end (z, y), and the screen. With line scans also the light of the
// shown line: from the line to the mirror points whose pixels it lights, and into the camera.

const LINE_RAYS = 9;
const INK = "#1c1c1c", GLASS = "#5a5a5a", TO_MIRROR = "#c2410c", TO_CAMERA = "#0b5d83";

class SetupView {
  constructor(setup) {
    this.setup = setup; this.frame = null;
    byId("setup").hidden = false;
    byId("rays").addEventListener("change", () => this.draw());
    window.addEventListener("resize", () => this.draw());
    this.draw();
  }

  // frame: { axis, place, rays: [[u, v, x, y, z], ...] } of the shown line.
  show(frame) { this.frame = frame; byId("rays-switch").hidden = false; this.draw(); }

  // The world point of a place on the screen's grid, between the told ones.
  world(u, v) {
    const { u: us, v: vs, world } = this.setup.screen;
    const at = (all, value) => {
      const share = (value - all[0]) / (all[all.length - 1] - all[0]) * (all.length - 1);
      const k = Math.min(Math.max(Math.floor(share), 0), all.length - 2);
      return [k, share - k];
    };
    const [i, a] = at(us, u), [j, b] = at(vs, v);
    return [0, 1, 2].map((c) => (1 - b) * ((1 - a) * world[j][i][c] + a * world[j][i + 1][c])
      + b * ((1 - a) * world[j + 1][i][c] + a * world[j + 1][i + 1][c]));
  }

  // Rays of the shown line as [screen, mirror, camera].
  lineRays() {
    if (!this.frame || !byId("rays").checked) return [];
    return this.frame.rays.map(([u, v, ...mirror]) => [this.world(u, v), mirror, this.setup.camera]);
  }

  // The lit line as two world points, or none.
  lit() {
    if (!this.frame) return [];
    const { u, v } = this.setup.screen, { axis, place } = this.frame;
    return axis === "x" ? [[place, v[0]], [place, v[v.length - 1]]] : [[u[0], place], [u[u.length - 1], place]];
  }

  draw() {
    const rays = this.lineRays();
    this.setup.views.forEach((view, k) => this.drawView(byId(`setup-${"xy"[k]}`), view, k, rays));
    this.drawScreen(byId("setup-screen"), rays);
    const line = rays.length ? `; ${rays.length} rays of line ${this.frame.axis} at ${digits(this.frame.place, 4)} mm` : "";
    byId("setup-text").textContent = `${Math.round(100 * this.setup.measured)} % of the mirror is seen and lit${line}.`;
  }

  drawView(svg, view, k, rays) {
    const { world } = this.setup.screen, edge = [...world[0], ...world[world.length - 1], ...world.map((row) => row[0]), ...world.map((row) => row[row.length - 1])];
    const points = [...view.mirror, ...edge, this.setup.camera], at = (p) => [p[2], p[k]];
    const draw = sheet(svg, points.map(at), `z [mm]`, `${"xy"[k]} [mm]`);
    const way = (ray, opacity, wide) => {
      draw.path([at(ray[0]), at(ray[1])], TO_MIRROR, wide, opacity);
      draw.path([at(ray[1]), at(ray[2])], TO_CAMERA, wide, opacity);
    };
    const faint = rays.length ? 0.2 : 0.7;
    for (const ray of view.chief) way(ray, faint, 0.8);
    for (const ray of view.marginal) way(ray, faint / 2, 0.6);
    for (const ray of rays) way(ray, 1, 1.2);
    draw.path(view.mirror.map(at), GLASS, 3);
    const middle = Math.floor(world.length / 2);
    draw.path(k === 0 ? world[middle].map(at) : world.map((row) => at(row[middle])), TO_MIRROR, 4);
    const lit = this.lit().map(([u, v]) => at(this.world(u, v)));
    if (lit.length) draw.path(lit, INK, 3);
    draw.square(at(this.setup.camera), TO_CAMERA);
    svg.setAttribute("aria-label", `set-up from the ${k ? "end" : "side"}: ${view.chief.length} chief rays` + (rays.length ? `, ${rays.length} rays of the shown line` : ""));
  }

  drawScreen(svg, rays) {
    const { u, v } = this.setup.screen, corners = [[u[0], v[0]], [u[u.length - 1], v[0]], [u[u.length - 1], v[v.length - 1]], [u[0], v[v.length - 1]], [u[0], v[0]]];
    const draw = sheet(svg, corners, "x on the screen [mm]", "y [mm]", 300);
    for (const place of this.setup.landing) draw.dot(place, TO_MIRROR, 1.2, rays.length ? 0.35 : 0.9);
    draw.path(corners, INK, 1.2);
    if (this.frame) draw.path(this.lit(), INK, 3);
    if (rays.length) for (const [a, b] of this.frame.rays) draw.dot([a, b], TO_MIRROR, 3, 1);
    svg.setAttribute("aria-label", "the screen: its edge, where the light of the mirror's points lands" + (this.frame ? ", and the lit line" : ""));
  }
}

// An SVG as wide as its place, with axes to one scale around the points [[right, up], ...].
function sheet(svg, points, xText, yText, most = 720) {
  const wide = Math.min(most, svg.parentElement.clientWidth || most), left = 58, bottom = 38, top = 8, right = 12;
  const span = (k) => { const all = points.map((p) => p[k]), low = Math.min(...all), high = Math.max(...all), more = 0.03 * (high - low) || 1; return [low - more, high + more]; };
  const [x0, x1] = span(0), [y0, y1] = span(1), scale = Math.min((wide - left - right) / (x1 - x0), 420 / (y1 - y0));
  const high = Math.max(60, scale * (y1 - y0)), across = scale * (x1 - x0);
  const at = ([x, y]) => [left + scale * (x - x0), top + high / 2 - scale * (y - (y0 + y1) / 2)];
  svg.setAttribute("viewBox", `0 0 ${wide} ${Math.round(top + high + bottom)}`);
  svg.setAttribute("width", wide); svg.setAttribute("height", Math.round(top + high + bottom));
  svg.replaceChildren();
  const add = (name, values, text = "") => {
    const one = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(values)) one.setAttribute(key, value);
    one.textContent = text; svg.append(one); return one;
  };
  add("rect", { x: left, y: top, width: across, height: high, fill: "none", stroke: "#767676" });
  for (const [value, anchor] of [[x0, "start"], [x1, "end"]]) add("text", { x: at([value, 0])[0], y: top + high + 15, "text-anchor": anchor }, digits(value, 3));
  for (const value of [y0, y1]) add("text", { x: left - 5, y: at([0, value])[1] + (value === y0 ? -1 : 11), "text-anchor": "end" }, digits(value, 3));
  add("text", { x: left + across / 2, y: top + high + 31, "text-anchor": "middle" }, xText);
  add("text", { x: 12, y: top + high / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${top + high / 2})` }, yText);
  return {
    path: (way, stroke, width, opacity = 1) => add("path", { d: `M${way.map((p) => at(p).map((c) => c.toFixed(1)).join(" ")).join("L")}`, fill: "none", stroke, "stroke-width": width, "stroke-opacity": opacity }),
    dot: (place, fill, r, opacity) => { const [cx, cy] = at(place); add("circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r, fill, "fill-opacity": opacity }); },
    square: (place, fill) => { const [x, y] = at(place); add("rect", { x: x - 5, y: y - 5, width: 10, height: 10, fill }); },
  };
}
