// The map so far of a running job, by the functions of maps.js.

async function main() {
  const { map } = JSON.parse(byId("data").textContent);
  if (map) {
    const [x, y, used, values] = await Promise.all([map.x, map.y, map.used, map.layers[0].map].map(unpack));
    const size = [Math.ceil(map.rows / map.step), Math.ceil(map.columns / map.step)], unit = map.layers[0].unit;
    const shown = withoutTerms(values, x, y, used, 3), s = statistics(shown);
    const most = Math.max(Math.abs(s.low), Math.abs(s.high)) || 1;
    const zoom = paint(byId("map"), shown, ...size, SIGNED, -most, most);
    rulers(map);
    writeStatistics(byId("map"), s, unit);
    markX(byId("map").getContext("2d"), map.towards, zoom, ...size);
    paintBar(byId("bar"), SIGNED, -most, most, unit);
    byId("statistics").textContent = `${map.layers[0].name}, piston and tilt removed: rms ${digits(s.rms, 4)} ${unit}, PV ${digits(s.pv, 4)} ${unit}, ${s.count} pixels`;
    byId("caption").textContent = "Seen from the camera; the arrow points to the mirror's +x.";
  }
  document.documentElement.dataset.ready = "yes";
}

main();
